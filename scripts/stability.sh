#!/usr/bin/env bash
# Where the numbers could break: runs the stability suite, prints its table, keeps it as JSON.

# shellcheck source=scripts/lib.sh
source "$(dirname -- "${BASH_SOURCE[0]}")/lib.sh"

usage="usage: scripts/stability.sh [FILE.json] [--readme | --check]

Sets up, builds, runs tests/stability.rs and prints a row for every case: what is extreme, what was checked, the figure,
its bound. Writes the rows to FILE.json (out/stability.json where not given), and the table of the methods to
stability/methods.md beside it.

  --readme  also remakes the shortened table of tests/README.md, and tests/stability/README.md
  --check   also fails when the table of tests/README.md lacks a case, has one too many or names another bound; figures may differ

Exits 0 when all cases hold, 1 when one does not."

json=out/stability.json
readme=
for argument in "$@"; do
    case $argument in
        -h | --help) printf '%s\n' "$usage" && exit 0 ;;
        --readme | --check) readme=$argument ;;
        -*) die "unknown argument '$argument'; see --help" ;;
        *) json=$argument ;;
    esac
done

bash scripts/setup.sh
ensure_cargo
say 'building and running (the first build takes minutes)'
mkdir -p out "$(dirname -- "$json")"
# The table says what failed; what the harness prints is kept beside it.
rm -f -- "$json"
STABILITY_JSON=$(realpath -m -- "$json") cargo test --locked --release --test stability >out/stability.log 2>&1 || true
[[ -f $json ]] || die "the suite did not run; see out/stability.log"
exec python3 scripts/readme/stability.py "$json" ${readme:+"$readme"}
