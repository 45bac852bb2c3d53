#!/usr/bin/env bash
# Everything that must pass before a commit: format, lints, tests. In the release profile, as demo.sh, to build once.

# shellcheck source=scripts/lib.sh
source "$(dirname -- "${BASH_SOURCE[0]}")/lib.sh"

only_help "usage: scripts/test.sh

Sets up (scripts/setup.sh), then runs cargo fmt --check, cargo clippy and cargo test, and compares the README's table of
stability with the run. Exits 0 when all pass.
Run by root where there is apt, it installs chromium for the tests of the diff page if no browser is there; CHROME
names one. Without a browser these tests are skipped, and say so." "$@"

bash scripts/setup.sh
ensure_cargo

for component in fmt clippy; do
    cargo "$component" --version >/dev/null 2>&1 ||
        die "cargo $component is missing: run 'rustup component add rustfmt clippy'"
done

# Tests of the diff page want a browser. Where there is none and we may install one, do; else those tests say that they are skipped.
provide_browser() {
    local name
    [[ -z ${CHROME-} ]] || return 0
    for name in chromium chromium-browser google-chrome; do
        ! type -P "$name" >/dev/null || return 0
    done
    [[ $(id -u) == 0 ]] && type -P apt-get >/dev/null || return 0
    say 'installing chromium for the tests of the diff page'
    { apt-get update && DEBIAN_FRONTEND=noninteractive apt-get install --yes --no-install-recommends chromium; } \
        >/dev/null 2>&1 || say 'chromium could not be installed; its tests will be skipped'
}

step() {
    say "$*"
    "$@" || die "failed: $*"
}

provide_browser
step cargo fmt --check
step cargo clippy --locked --release --all-targets -- -D warnings
export STABILITY_JSON=$root/out/stability.json
mkdir -p out
step cargo test --locked --release
step python3 scripts/readme/stability.py "$STABILITY_JSON" --check
say 'all passed'
