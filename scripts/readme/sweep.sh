#!/usr/bin/env bash
# Remakes the plot of src/sweep/README.md: error against bake time in two open rooms, along a few ladders.

# shellcheck source=scripts/lib.sh
source "$(dirname -- "${BASH_SOURCE[0]}")/../lib.sh"

only_help "usage: scripts/readme/sweep.sh

Sets up, builds, sweeps scenes/two_rooms_open.glb along configs/sweeps/readme.ron and writes scripts/readme/sweep.png. A few
minutes; an interrupted one goes on where it stopped. LIGHTPROBE names a binary to use instead of building one." "$@"

provide_lightprobe

work=out/readme-sweep
"$lightprobe" sweep scenes/two_rooms_open.glb -o "$work" --ladder configs/sweeps/readme.ron --size 160x90 --reference 128
cp -- "$work/error_time.png" scripts/readme/sweep.png

du -b -- scripts/readme/sweep.png
