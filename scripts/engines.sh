#!/usr/bin/env bash
# Compares exports in real engines, pixel by pixel, with what `render` makes of them. Not part of test.sh: it needs npm.

# shellcheck source=scripts/lib.sh
source "$(dirname -- "${BASH_SOURCE[0]}")/lib.sh"

only_help "usage: scripts/engines.sh

Sets up, fetches npm's three 0.187.0 into .deps/engines where it is not there, and runs tests/engines: three.js in a headless
browser, with WebGL 2 in software, on a scene that is baked and exported for it. Needs npm and Chromium or Chrome (CHROME)." "$@"

version=0.187.0
folder=$root/.deps/engines/three-$version

bash scripts/setup.sh
ensure_cargo
if [[ ! -d $folder ]]; then
    type -P npm >/dev/null || die "npm is not on the path: install Node.js"
    say "fetching three $version"
    mkdir -p "$root/.deps/engines"
    work=$(mktemp -d "$root/.deps/engines/fetch.XXXXXX")
    trap 'rm -rf "$work"' EXIT
    (cd "$work" && npm pack --silent "three@$version" >/dev/null && tar xzf "three-$version.tgz")
    mv "$work/package" "$folder"
fi
LIGHTPROBE_THREE=$folder CI=true cargo test --release --test engines
