#!/usr/bin/env bash
# Everything that must pass before a commit: format, lints, tests. In the release profile, as demo.sh, to build once.

# shellcheck source=scripts/lib.sh
source "$(dirname -- "${BASH_SOURCE[0]}")/lib.sh"

only_help "usage: scripts/test.sh

Sets up (scripts/setup.sh), then runs cargo fmt --check, cargo clippy and cargo test, and compares the table of
stability in tests/README.md with the run. Exits 0 when all pass.
Some tests need a browser, the Python packages safetensors and numpy, or the shared scenes (LIGHTPROBE_SHARED, or
../shared). Run by root where there is apt, it installs chromium if no browser is there; CHROME names one. The packages
it puts in .deps/python. Tests whose need is not met are ignored, and the last line says how many and why; with CI=true
they fail, unless LIGHTPROBE_WITHOUT names the need (a list: browser,python,safetensors,shared)." "$@"

bash scripts/setup.sh
ensure_cargo

for component in fmt clippy; do
    cargo "$component" --version >/dev/null 2>&1 ||
        die "cargo $component is missing: run 'rustup component add rustfmt clippy'"
done

# Tests of the diff page need a browser. Where there is none and we may install one, do.
provide_browser() {
    local name
    [[ -z ${CHROME-} ]] || return 0
    for name in chromium chromium-browser google-chrome; do
        ! type -P "$name" >/dev/null || return 0
    done
    [[ $(id -u) == 0 ]] && type -P apt-get >/dev/null || return 0
    say 'installing chromium for the tests of the diff page'
    { apt-get update && DEBIAN_FRONTEND=noninteractive apt-get install --yes --no-install-recommends chromium; } \
        >/dev/null 2>&1 || say 'chromium could not be installed'
}

# A test reads probe files in Python.
provide_safetensors() {
    local try='from safetensors.numpy import load_file' scratch
    type -P python3 >/dev/null && ! python3 -c "$try" 2>/dev/null || return 0
    if [[ ! -d $deps/python ]]; then
        say 'installing safetensors and numpy for the test that reads probe files in Python'
        scratch=$(mktemp -d "$deps/tmp.XXXXXX")
        python3 -m pip install --quiet --disable-pip-version-check --target "$scratch" safetensors numpy \
            >/dev/null 2>&1 && mv -- "$scratch" "$deps/python" || { rm -rf -- "$scratch" && say 'they could not be installed'; }
    fi
    [[ ! -d $deps/python ]] || export PYTHONPATH=$deps/python${PYTHONPATH:+:$PYTHONPATH}
}

# What tests/common/needs.rs wrote down, in one line: lines of need, tab, name of a test.
ignored_tests() { # FILE
    local needs
    [[ -s $1 ]] || { echo 'no test ignored' && return; }
    needs=$(cut -f 1 "$1" | sort | uniq -c | while read -r count need; do printf ', %s without %s' "$count" "$need"; done)
    printf '%s tests ignored: %s (see tests/common/needs.rs)' "$(wc -l <"$1")" "${needs#, }"
}

step() {
    say "$*"
    "$@" || die "failed: $*"
}

provide_browser
provide_safetensors
step cargo fmt --check
step cargo clippy --locked --release --all-targets -- -D warnings
export STABILITY_JSON=$root/out/stability.json
mkdir -p out
export LIGHTPROBE_IGNORED=$root/out/ignored_tests.tsv
rm -f -- "$LIGHTPROBE_IGNORED"
step cargo test --locked --release
step python3 scripts/readme/stability.py "$STABILITY_JSON" --check
say "all passed; $(ignored_tests "$LIGHTPROBE_IGNORED")"
