#!/usr/bin/env bash
# What a job of continuous integration does with a scene: bake it, render it, compare it with what was accepted.

# shellcheck source=scripts/lib.sh
source "$(dirname -- "${BASH_SOURCE[0]}")/lib.sh"

only_help "usage: scripts/ci-example.sh

Bakes and renders scenes/two_rooms_open.glb and compares the result with tests/golden/two_rooms_open/. Exits with 0 within
thresholds, 1 beyond them, 2 on an error. out/ci/diff/ holds diff.md for a comment under the pull request, junit.xml for the
job's list of tests, diff.json for everything else. UPDATE=1 accepts what was made: the baseline is replaced.
LIGHTPROBE names a binary to use instead of building one." "$@"

provide_lightprobe

name=two_rooms_open
result=out/ci/$name

rm -rf -- "$result"
mkdir -p "$result"
"$lightprobe" bake "scenes/$name.glb" -q -o "$result/$name.probes" --report "$result/bake.json" --set grid.spacing_m=2
for camera in lit dark; do
    "$lightprobe" render "scenes/$name.glb" "$result/$name.probes" -q -o "$result/$camera" --camera "$camera" --size 64x36
    # A baseline that is kept with the sources stays small: what decides is the report and the picture with visibility.
    find "$result/$camera" -type f ! -name report.json ! -name visibility_on.exr -delete
done

status=0
"$lightprobe" diff-report "tests/golden/$name" "$result" -o out/ci/diff --thresholds tests/golden/thresholds.ron \
    ${UPDATE:+--update-baseline} || status=$?
# Where the runner shows a summary, this is it.
if [[ -n ${GITHUB_STEP_SUMMARY-} && $status -lt 2 ]]; then
    cat out/ci/diff/diff.md >>"$GITHUB_STEP_SUMMARY"
fi
exit "$status"
