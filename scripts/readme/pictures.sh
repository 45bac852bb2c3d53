#!/usr/bin/env bash
# Remakes the README's pictures: the same two rooms, sealed and open, from the lit and from the dark side.

# shellcheck source=scripts/lib.sh
source "$(dirname -- "${BASH_SOURCE[0]}")/../lib.sh"

only_help "usage: scripts/readme/pictures.sh

Sets up, builds, bakes both two-room scenes and writes scripts/readme/SCENE.CAMERA.{without,with,leak}.png and probes.png.
LIGHTPROBE names a binary to use instead of building one." "$@"

provide_lightprobe

here=scripts/readme
work=out/readme-pictures
# One exposure for all pictures of a camera, so that the two scenes compare.
declare -A exposure_ev=([lit]=-0.5 [dark]=2)

for scene in two_rooms_sealed two_rooms_open; do
    mkdir -p "$work"
    "$lightprobe" bake "scenes/$scene.glb" --config "configs/scenes/$scene.ron" -o "$work/$scene.probes" >&2
    for camera in lit dark; do
        folder=$work/$scene.$camera
        "$lightprobe" render "scenes/$scene.glb" "$work/$scene.probes" -o "$folder" \
            --camera "$camera" --size 480x270 --exposure "${exposure_ev[$camera]}" >&2
        cp -- "$folder/visibility_off.png" "$here/$scene.$camera.without.png"
        cp -- "$folder/visibility_on.png" "$here/$scene.$camera.with.png"
        cp -- "$folder/leak.png" "$here/$scene.$camera.leak.png"
    done
done
cp -- "$work/two_rooms_open.lit/probes.png" "$here/probes.png"

du -b -- "$here"/*.png
