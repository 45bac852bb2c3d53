#!/usr/bin/env bash
# Everything that must pass before a commit: format, lints, tests. In the release profile, as demo.sh, to build once.

# shellcheck source=scripts/lib.sh
source "$(dirname -- "${BASH_SOURCE[0]}")/lib.sh"

only_help "usage: scripts/test.sh

Sets up (scripts/setup.sh), then runs cargo fmt --check, cargo clippy and cargo test, and compares the README's table of
stability with the run. Exits 0 when all pass." "$@"

bash scripts/setup.sh
ensure_cargo

for component in fmt clippy; do
    cargo "$component" --version >/dev/null 2>&1 ||
        die "cargo $component is missing: run 'rustup component add rustfmt clippy'"
done

step() {
    say "$*"
    "$@" || die "failed: $*"
}

step cargo fmt --check
step cargo clippy --locked --release --all-targets -- -D warnings
export STABILITY_JSON=$root/out/stability.json
mkdir -p out
step cargo test --locked --release
step python3 scripts/readme/stability.py "$STABILITY_JSON" --check
say 'all passed'
