#!/usr/bin/env bash
# What an export leaks, errs and weighs in each engine: without a fit, with it, with a volume for each room.

# shellcheck source=scripts/lib.sh
source "$(dirname -- "${BASH_SOURCE[0]}")/../lib.sh"

only_help "usage: scripts/readme/exports.sh

Sets up, builds, bakes four scenes on five grids each (the scene's own and four shifted ones), exports each bake to three and
to Bevy in four ways (one volume or --volumes auto, without and with --fit), renders each export as its engine does, against
one reference a camera, and prints the tables of src/export/README.md. Results lie in out/exports; what is there is not made
again, so that a run that was stopped goes on. LIGHTPROBE_ALBUM=out/exports/album.json LIGHTPROBE_PAGE_SHOTS=DIR
scripts/engines.sh then has the engines make the pictures of the first grid, and puts them beside ours into DIR.

LIGHTPROBE names a binary to use instead of building one, SCENES some of the scenes, OFFSETS how many of the grids, SHARED the
folder that holds scenes/veach_ajar and scenes/bathroom (../shared), THREADS threads, SIZE and SPP other pictures." "$@"

provide_lightprobe
export LIGHTPROBE=$lightprobe
exec python3 scripts/readme/exports.py
