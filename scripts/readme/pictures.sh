#!/usr/bin/env bash
# Remakes the README's pictures: the same two rooms, sealed and open, from the lit and from the dark side.

# shellcheck source=scripts/lib.sh
source "$(dirname -- "${BASH_SOURCE[0]}")/../lib.sh"

only_help "usage: scripts/readme/pictures.sh

Sets up, builds, bakes both two-room scenes and writes scripts/readme/SCENE.CAMERA.{without,with,leak}.png and probes.png.
Pictures without visibility and leak maps are of the preset physical: the default's values are fitted with visibility.
LIGHTPROBE names a binary to use instead of building one." "$@"

provide_lightprobe

here=scripts/readme
work=out/readme-pictures
# One exposure for all pictures of a camera, so that the two scenes compare.
declare -A exposure_ev=([lit]=-0.5 [dark]=2)

for scene in two_rooms_sealed two_rooms_open; do
    mkdir -p "$work"
    for preset in physical default; do
        probes=$work/$scene.$preset.probes
        "$lightprobe" bake "scenes/$scene.glb" --preset "$preset" --config "configs/scenes/$scene.ron" -o "$probes" >&2
        for camera in lit dark; do
            "$lightprobe" render "scenes/$scene.glb" "$probes" -o "$work/$scene.$camera.$preset" \
                --camera "$camera" --size 480x270 --exposure "${exposure_ev[$camera]}" >&2
        done
    done
    for camera in lit dark; do
        cp -- "$work/$scene.$camera.physical/visibility_off.png" "$here/$scene.$camera.without.png"
        cp -- "$work/$scene.$camera.default/visibility_on.png" "$here/$scene.$camera.with.png"
        cp -- "$work/$scene.$camera.physical/leak.png" "$here/$scene.$camera.leak.png"
    done
done
cp -- "$work/two_rooms_open.lit.default/probes.png" "$here/probes.png"

du -b -- "$here"/*.png
