#!/usr/bin/env bash
# Tries what package.sh made in root file systems of bare systems, such as debootstrap makes.

# shellcheck source=scripts/lib.sh
source "$(dirname -- "${BASH_SOURCE[0]}")/../lib.sh"

[[ $# -gt 0 && ${1:-} != -h && ${1:-} != --help ]] || {
    printf '%s\n' "usage: scripts/package/bare.sh ROOT...

Copies the archive and the wheel of out/package/ into each root file system, and there, as with a fresh machine,
unpacks, bakes and renders; installs the wheel where there is python3 with venv. Needs root. One is made by

  debootstrap --variant=minbase --include=python3,python3-venv bookworm ROOT"
    [[ $# -gt 0 ]] || exit 2
    exit 0
}

# What runs inside: no variable, no compiler, nothing but the system's own.
read -r -d '' inside <<'SH' || true
set -eu
cd /tmp/lightprobe-try
tar -xzf lightprobe-*.tar.gz --strip 1
scene=scenes/cornell.glb
bin/lightprobe bake "$scene" -q --set 'grid.divisions=(3,3,3)' -o archive.probes >/dev/null
bin/lightprobe render "$scene" archive.probes -q --size 32x18 -o pictures >/dev/null
start() { # FLAG: milliseconds, the median of nine
    for _ in 1 2 3 4 5 6 7 8 9; do
        before=$(date +%s%N)
        bin/lightprobe "$1" >/dev/null
        echo $((($(date +%s%N) - before) / 1000000))
    done | sort -n | sed -n 5p
}
said="archive runs, --version $(start --version) ms, --help $(start --help) ms"
if command -v python3 >/dev/null && python3 -m venv venv >/dev/null 2>&1; then
    venv/bin/pip install --quiet --no-index ./*.whl
    venv/bin/lightprobe bake "$scene" -q --set 'grid.divisions=(3,3,3)' -o wheel.probes >/dev/null
    cmp archive.probes wheel.probes
    said="$said; wheel runs, same bytes"
fi
for tool in cc gcc clang cargo; do
    if command -v "$tool" >/dev/null; then said="$said; not bare: $tool"; fi
done
. /etc/os-release
echo "$PRETTY_NAME, $(ldd --version | sed -n '1s/.* //p'): $said"
SH

for root in "$@"; do
    try=$root/tmp/lightprobe-try
    rm -rf -- "$try"
    mkdir -p "$try"
    cp -- out/package/*.tar.gz out/package/*.whl "$try/"
    # The loader finds what lies beside a program by /proc.
    # shellcheck disable=SC2016
    unshare --mount --fork bash -c 'mount -t proc proc "$1/proc" && exec chroot "$1" /usr/bin/env -i PATH=/usr/bin:/bin HOME=/root sh -c "$2"' \
        bash "$root" "$inside"
    rm -rf -- "$try"
done
