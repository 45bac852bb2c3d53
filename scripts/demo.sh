#!/usr/bin/env bash
# The shortest way to pictures: a lit room and a dark one behind a closed wall, where any light is leaked light.

# shellcheck source=scripts/lib.sh
source "$(dirname -- "${BASH_SOURCE[0]}")/lib.sh"

only_help "usage: scripts/demo.sh

Sets up (scripts/setup.sh), builds, bakes scenes/two_rooms_sealed.glb and renders both its cameras to out/demo/.
LIGHTPROBE names a binary to use instead of building one." "$@"

provide_lightprobe

scene=scenes/two_rooms_sealed.glb
probes=out/demo/two_rooms_sealed.probes
cameras=(lit dark)

mkdir -p out/demo
"$lightprobe" bake "$scene" --config configs/scenes/two_rooms_sealed.ron -o "$probes" --report out/demo/bake.json
for camera in "${cameras[@]}"; do
    "$lightprobe" render "$scene" "$probes" -o "out/demo/$camera" --camera "$camera"
done

printf '\nProbes and report: %s, out/demo/bake.json\nPictures:\n' "$probes"
find "${cameras[@]/#/out/demo/}" -name '*.png' | sort | sed 's/^/  /'
