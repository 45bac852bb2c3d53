#!/usr/bin/env bash
# Two rooms with 16 probes each, sealed and open, as Luo (2022) tested them: does light leak, what does visibility cost,
# are outer faces lit?

# shellcheck source=scripts/lib.sh
source "$(dirname -- "${BASH_SOURCE[0]}")/../lib.sh"

only_help "usage: scripts/readme/two_rooms.sh

Sets up, builds, bakes both two-room scenes with 4 × 2 × 2 probes within the rooms by every preset, renders both rooms
and the outside, and prints the published table's columns with ours beside them. Results lie in out/methods/rooms; what
is there is not made again. LIGHTPROBE names a binary to use instead of building one, THREADS its threads, SIZE and SPP
other pictures." "$@"

provide_lightprobe

size=${SIZE:-480x270}
spp=${SPP:-256}
threads=${THREADS:-0}
work=out/methods/rooms
mkdir -p "$work"
# A quarter of a room from its walls, above the furniture: x = ±1 and ±3 m on either side of the wall at 0.
inside='(min: (-3, 1.2, -1), max: (3, 2.4, 1))'
# The inner faces of the walls: only a method that moves probes off them can use it.
walls='(min: (-4.05, 0, -2), max: (4.05, 3, 2))'
declare -A view=([lit]='--camera lit' [dark]='--camera dark' [outside]='--look-at=-8,6,9,0,1,0,45')

for scene in two_rooms_sealed two_rooms_open; do
    for row in physical physical.walls irradiance-2022 lightfield-2022 mcguire-2017 ddgi-2019 threev8-uniform threev8-mixed; do
        folder=$work/$scene.$row
        bounds=$inside
        [[ $row != *.walls ]] || bounds=$walls
        mkdir -p "$folder"
        [[ -f $folder/bake.json ]] ||
            "$lightprobe" bake "scenes/$scene.glb" --preset "${row%.walls}" --set "grid.bounds=$bounds" \
                --set 'grid.divisions=(4, 2, 2)' -o "$folder/probes" --report "$folder/bake.json" --threads "$threads" >&2
        for camera in lit dark outside; do
            [[ ! -f $folder/$camera/report.json ]] || continue
            read -ra words <<<"${view[$camera]}"
            # One reference a scene and camera.
            reference=$work/$scene.physical/$camera/reference.exr
            against=(--reference "$spp")
            [[ ! -f $reference ]] || against=(--reference-image "$reference")
            "$lightprobe" render "scenes/$scene.glb" "$folder/probes" -o "$folder/$camera" "${words[@]}" \
                --size "$size" "${against[@]}" --threads "$threads" >&2
        done
    done
done
python3 scripts/readme/methods.py rooms
