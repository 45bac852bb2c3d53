#!/usr/bin/env bash
# The comparison of all methods: sweeps of every scene, and the tables, curves and contact sheet made of them.

# shellcheck source=scripts/lib.sh
source "$(dirname -- "${BASH_SOURCE[0]}")/../lib.sh"

usage="usage: scripts/readme/methods.sh [--tables]

Sets up, builds, and sweeps all presets over each scene, in these parts:

  positions  the same bounds and spacing for all methods; those of more than 8 KiB a probe with maps of 64²
  bytes      as many probes as fit into twice the bytes that the default needs there, methods of more than 8 KiB a probe with
             smaller maps; wants 'positions' first
  offsets    the default and the two published methods that err least in 'bytes', on five shifted grids; wants 'bytes' first
  ablation   the default without each of its ingredients
  curves     a ladder of spacings, for error against bake time and against shading time; only where PARTS names it
  mixed      the mixed grid against the uniform one at the same finest spacing; only where PARTS names it

Results lie in out/methods/SCENE/PART. A sweep that was interrupted goes on where it stopped; scenes do not depend on
each other and may run at the same time. The tables of what there is are printed as Markdown.

  --tables   runs nothing: puts the tables of what lies in out/methods between the markers of configs/presets/README.md, and
             the pictures into scripts/readme/

FULL=1 takes published resolutions on equal positions, as the tables of the README have them: four hours of two cores more.
LIGHTPROBE names a binary to use instead of building one, SCENES and PARTS lists of these, SHARED the folder that holds
scenes/veach_ajar and scenes/bathroom (../shared), THREADS the threads of each sweep, SIZE and SPP other pictures,
SPACING other grids than the scenes' own (for a quick look only)."

tables=
for argument in "$@"; do
    case $argument in
        -h | --help) printf '%s\n' "$usage" && exit 0 ;;
        --tables) tables=1 ;;
        *) die "unknown argument '$argument'; see --help" ;;
    esac
done

methods=scripts/readme/methods.py
if [[ -n $tables ]]; then
    exec python3 "$methods" publish
fi

provide_lightprobe
export LIGHTPROBE=$lightprobe

size=${SIZE:-192x108}
spp=${SPP:-512}
read -ra scenes <<<"${SCENES:-$(python3 "$methods" scenes)}"
read -ra parts <<<"${PARTS:-positions bytes offsets ablation}"

# One part of a scene; its runs lie beside the scene's other parts, which share some of them.
sweep() { # SCENE PART
    local folder=out/methods/$1/$2 reference=out/methods/$1/positions/reference.exr lines words
    lines=$(python3 "$methods" prepare "$1" "$2")
    [[ -n $lines ]] || return 0
    mapfile -t words <<<"$lines"
    [[ -e $folder/runs ]] || ln -s ../runs "$folder/runs"
    [[ -f $folder/reference.exr || ! -f $reference ]] || cp -- "$reference" "$folder/reference.exr"
    say "$1, $2"
    "$lightprobe" sweep "${words[@]}" -o "$folder" --ladder "$folder/ladder.ron" --size "$size" --reference "$spp" \
        --seeds 1 --threads "${THREADS:-0}" >&2
}

for scene in "${scenes[@]}"; do
    file=$(python3 "$methods" file "$scene")
    [[ -f $file ]] || { say "$file is not there: $scene is left out" && continue; }
    mkdir -p "out/methods/$scene/runs"
    for part in "${parts[@]}"; do
        sweep "$scene" "$part"
    done
done
python3 "$methods" show "${scenes[@]}"
