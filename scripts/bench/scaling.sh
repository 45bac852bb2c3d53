#!/usr/bin/env bash
# How a bake's time and memory grow. Times compare within one run only.

# shellcheck source=scripts/lib.sh
source "$(dirname -- "${BASH_SOURCE[0]}")/../lib.sh"

text="usage: scripts/bench/scaling.sh [--long]

Bakes, the median of three each, and prints with the exponent of growth where it is one

  probes        office with 10², 10³ and 10⁴ probes (--long: 10⁵): time by stage, peak memory
  triangles     a room with a wavy floor of 10⁴, 10⁵ and 10⁶ triangles (--long: 10⁷), 64 probes
  lights        a room with 1, 16 and 256 point lights
  threads       office with 10³ probes on 1, 2, 4 … all threads: efficiency of each stage
  bounces       office, preset physical, up to 1, 4 and 16 bounces
  budget        cornell, preset physical, under budgets from nothing to 1 GiB: peak memory, time
  dry run       its time ÷ the bake's, predicted ÷ measured time and memory, of six scenes

Everything goes to out/bench/scaling.json, and a plot of each to out/bench/NAME.svg.
LIGHTPROBE names a binary to use instead of building one."
long=
[[ ${1-} == --long ]] && long=yes && shift
only_help "$text" "$@"

provide_lightprobe

exec python3 scripts/bench/scaling.py "$lightprobe" "${long:-no}"
