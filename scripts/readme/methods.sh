#!/usr/bin/env bash
# All methods on all scenes: the README's tables and its contact sheet.

# shellcheck source=scripts/lib.sh
source "$(dirname -- "${BASH_SOURCE[0]}")/../lib.sh"

only_help "usage: scripts/readme/methods.sh

Sets up, builds, and sweeps all presets over the scenes of scenes/ and, where they are there, ../shared/scenes: on equal
positions in out/methods/SCENE. Prints a table of Markdown a scene. Where sweeps were interrupted they go on.
LIGHTPROBE names a binary to use instead of building one; SCENES a list of scenes, SIZE and SPP other pictures." "$@"

provide_lightprobe

size=${SIZE:-192x108}
spp=${SPP:-256}
read -ra scenes <<<"${SCENES:-two_rooms_sealed two_rooms_open thin_wall cornell courtyard office veach_ajar bathroom}"
work=out/methods
mkdir -p "$work"

# Where a scene is, and what it needs besides its configuration.
arguments() { # SCENE
    case $1 in
        veach_ajar) echo ../shared/scenes/veach_ajar/veach_ajar.glb --set grid.spacing_m=0.7 ;;
        bathroom) echo ../shared/scenes/bathroom/LAZIENKA.gltf --env 1,1,1 ;;
        courtyard) echo scenes/courtyard.glb --config configs/scenes/courtyard.ron --env 0.6,0.8,1.2 ;;
        *) echo "scenes/$1.glb" --config "configs/scenes/$1.ron" ;;
    esac
}

for scene in "${scenes[@]}"; do
    read -ra words <<<"$(arguments "$scene")"
    [[ -f ${words[0]} ]] || { say "${words[0]} is not there: $scene is left out" && continue; }
    "$lightprobe" sweep "${words[@]}" -o "$work/$scene" --preset all --equal positions --size "$size" \
        --reference "$spp" --seeds 1 >&2
    printf '\n%s\n\n' "$scene"
    python3 - "$work/$scene/sweep.json" <<'PYTHON'
import json
import sys

report = json.load(open(sys.argv[1], encoding="utf-8"))


def percent(value):
    return "–" if value is None else f"{100 * value:.3g} %"


def seconds(value):
    return "–" if value is None else f"{value:.3g} s"


columns = [
    ("error", "error_relative", percent),
    ("corners", "error_corner", percent),
    ("elsewhere", "error_flat", percent),
    ("in air", "air_error", percent),
    ("leak light", "leak_light", percent),
    ("leak dark", "leak_dark", percent),
    ("blocks", "leak_blocks", percent),
    ("dark region", "leak_dark_region", percent),
    ("bake", "bake_s", seconds),
    ("shade", "shade_ms", lambda value: "–" if value is None else f"{value:.3g} ms"),
    ("bytes per probe", "bytes_per_probe", lambda value: "–" if value is None else f"{value:,.0f}"),
]
print("| method | " + " | ".join(name for name, _, _ in columns) + " |")
print("|---|" + "---|" * len(columns))
for configuration in report["configurations"]:
    figures = configuration["figures"]

    def typical(key):
        figure = figures[key]
        return figure["mean"] if figure["geometric_mean"] is None else figure["geometric_mean"]

    cells = [form(typical(key)) for _, key, form in columns]
    print(f"| `{configuration['label']}` | " + " | ".join(cells) + " |")
PYTHON
done
