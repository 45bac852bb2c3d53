#!/usr/bin/env bash
# The shortest way to pictures: a lit room and a dark one behind a closed wall, where any light is leaked light.

# shellcheck source=scripts/lib.sh
source "$(dirname -- "${BASH_SOURCE[0]}")/lib.sh"

only_help "usage: scripts/demo.sh

Sets up (scripts/setup.sh), builds, bakes scenes/two_rooms_sealed.glb and renders both its cameras to out/demo/." "$@"

bash scripts/setup.sh
ensure_cargo

scene=scenes/two_rooms_sealed.glb
probes=out/demo/two_rooms_sealed.probes
cameras=(lit dark)

# cargo says where the binary is, whatever CARGO_TARGET_DIR and its configuration make of it.
build() {
    cargo build --locked --release --bin lightprobe --message-format=json-render-diagnostics |
        sed -n 's/.*"executable":"\([^"]*\)".*/\1/p' | tail -n 1
}

say 'building (the first time takes minutes)'
lightprobe=$(build) || die 'the build failed; cargo says above why'
[[ -x $lightprobe ]] || die "cargo built no lightprobe ('$lightprobe')"

mkdir -p out/demo
"$lightprobe" bake "$scene" --config configs/scenes/two_rooms_sealed.ron -o "$probes" --report out/demo/bake.json
for camera in "${cameras[@]}"; do
    "$lightprobe" render "$scene" "$probes" -o "out/demo/$camera" --camera "$camera"
done

printf '\nProbes and report: %s, out/demo/bake.json\nPictures:\n' "$probes"
find "${cameras[@]/#/out/demo/}" -name '*.png' | sort | sed 's/^/  /'
