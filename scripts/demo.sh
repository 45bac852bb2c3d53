#!/usr/bin/env bash
# The shortest way to pictures: a lit room and a dark one behind a closed wall, where any light is leaked light.

# shellcheck source=scripts/lib.sh
source "$(dirname -- "${BASH_SOURCE[0]}")/lib.sh"

only_help "usage: scripts/demo.sh

Sets up (scripts/setup.sh), builds, bakes scenes/two_rooms_sealed.glb and renders both its cameras to out/demo/: as the default
does it, and for the pictures without visibility, in out/demo/physical/, by the preset physical. Values that were fitted with
visibility would say nothing without it. Each camera is path-traced too, so that errors are known. At last it writes a page to
look at both bakes in a browser: out/demo/view.html and out/demo/physical/view.html.
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
    "$lightprobe" render "$scene" "$probes" -o "out/demo/$camera" "${common[@]}" --reference 64
    "$lightprobe" render "$scene" "$physical" -o "out/demo/physical/$camera" "${common[@]}" --quiet \
        --reference-image "out/demo/$camera/reference.exr"
done
"$lightprobe" view "$scene" "$probes" -o out/demo/view.html
"$lightprobe" view "$scene" "$physical" -o out/demo/physical/view.html --quiet

printf '\nProbes and report: %s, out/demo/bake.json\n' "$probes"
printf 'Pictures, with visibility and without:\n'
for camera in lit dark; do
    printf '  %s\n' "out/demo/$camera/visibility_on.png" "out/demo/physical/$camera/visibility_off.png"
done
printf 'References, leaks, light of all probes, maps of errors: beside them\n'
printf 'The dark room is black because its wall is complete: reference.png shows that no light comes through. What it has without\n'
printf 'visibility has leaked.\n'
printf 'Pages to look at the bakes in a browser:\n'
printf '  %s\n' out/demo/view.html out/demo/physical/view.html
