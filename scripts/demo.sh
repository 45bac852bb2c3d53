#!/usr/bin/env bash
# The shortest way to pictures: a lit room and a dark one behind a closed wall, where any light is leaked light.

# shellcheck source=scripts/lib.sh
source "$(dirname -- "${BASH_SOURCE[0]}")/lib.sh"

only_help "usage: scripts/demo.sh

Sets up (scripts/setup.sh), builds, bakes scenes/two_rooms_sealed.glb and renders both its cameras to out/demo/: as the default
does it, and for the pictures without visibility, in out/demo/physical/, by the preset physical. Values that were fitted with
visibility would say nothing without it.
LIGHTPROBE names a binary to use instead of building one." "$@"

provide_lightprobe

scene=scenes/two_rooms_sealed.glb
config=configs/scenes/two_rooms_sealed.ron
probes=out/demo/two_rooms_sealed.probes
physical=out/demo/physical/two_rooms_sealed.probes
# One exposure for both pictures of a camera, so that they compare.
declare -A exposure_ev=([lit]=-0.5 [dark]=2)

mkdir -p out/demo/physical
"$lightprobe" bake "$scene" --config "$config" -o "$probes" --report out/demo/bake.json
"$lightprobe" bake "$scene" --preset physical --config "$config" -o "$physical" --quiet
for camera in lit dark; do
    common=(--camera "$camera" --exposure "${exposure_ev[$camera]}")
    "$lightprobe" render "$scene" "$probes" -o "out/demo/$camera" "${common[@]}"
    "$lightprobe" render "$scene" "$physical" -o "out/demo/physical/$camera" "${common[@]}" --quiet
done

printf '\nProbes and report: %s, out/demo/bake.json\n' "$probes"
printf 'Pictures, with visibility and without:\n'
for camera in lit dark; do
    printf '  %s\n' "out/demo/$camera/visibility_on.png" "out/demo/physical/$camera/visibility_off.png"
done
printf 'Leaks, light of all probes, maps of errors: beside them\n'
