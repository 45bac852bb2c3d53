#!/usr/bin/env bash
# An archive that runs where nothing was installed: the program, Embree and its TBB beside it, licences, two scenes.

# shellcheck source=scripts/lib.sh
source "$(dirname -- "${BASH_SOURCE[0]}")/lib.sh"

only_help "usage: scripts/package.sh

Sets up, builds, and makes in out/package/

  lightprobe-VERSION-x86_64-linux.tar.gz         unpack it anywhere and run bin/lightprobe
  lightprobe-VERSION-py3-none-PLATFORM.whl       pip install it; the program is then on the environment's PATH

and tries both in an empty environment: no variable, no library but the C and C++ ones of any Debian or Ubuntu, in a root
folder of its own where the system allows that. Prints sizes, the time of a start, and the oldest glibc that will do.
LIGHTPROBE names a binary to use instead of building one." "$@"

provide_lightprobe

version=$("$lightprobe" --version | cut -d ' ' -f 2)
name=lightprobe-$version-x86_64-linux
work=out/package
stage=$work/$name

rm -rf -- "$work"
mkdir -p "$stage/bin" "$stage/lib" "$stage/licences"
# Without the lines of the source: a fifth of the size.
strip --strip-debug -o "$stage/bin/lightprobe" "$lightprobe" || die 'strip (binutils) is needed'
while read -r library; do
    cp -L -- "$library" "$stage/lib/"
done < <(ldd "$lightprobe" | sed -n 's/.* => \(.*lib\(embree4\|tbb\)[^ ]*\) .*/\1/p')
chmod 755 "$stage/bin/lightprobe"
cp -- LICENSE-MIT LICENSE-APACHE "$stage/"
cp -r -- README.md configs "$stage/"
mkdir "$stage/scenes"
cp -- scenes/cornell.glb scenes/two_rooms_open.glb "$stage/scenes/"
cp -- src/report/assets/DejaVuSans-LICENSE.txt "$stage/licences/"
ensure_cargo
cargo metadata --locked --format-version 1 2>/dev/null | python3 scripts/package/licences.py >"$stage/licences/THIRD-PARTY.md"
python3 scripts/package/rpath.py "$stage/bin/lightprobe" '$ORIGIN:$ORIGIN/../lib'

# Everything that the loader takes must be in the archive, or be of the C and C++ runtimes.
check_libraries() { # PROGRAM FOLDER
    local line
    while read -r line; do
        case $line in
            *"$2"/* | linux-vdso* | */ld-linux* | lib[cm].so* | libpthread.so* | libdl.so* | librt.so* | libstdc++.so* | \
                libgcc_s.so*) ;;
            *) die "the program needs something else: $line" ;;
        esac
    done < <(env -i ldd "$1")
}
check_libraries "$stage/bin/lightprobe" "$(cd "$stage" && pwd -P)"

tar -C "$work" -czf "$work/$name.tar.gz" "$name"
glibc=$(objdump -T "$stage/bin/lightprobe" "$stage"/lib/* | grep -o 'GLIBC_[0-9.]*' | sort -Vu | tail -n 1)
glibc=${glibc#GLIBC_}
wheel=$(python3 scripts/package/wheel.py "$stage" "$version" "manylinux_${glibc/./_}_x86_64" "$work")

# A root that holds the archive and the system's C and C++ libraries, and no more.
try_in_own_root() {
    local root=$work/root library
    mkdir -p "$root/tmp"
    tar -C "$root" -xzf "$work/$name.tar.gz"
    while read -r library; do
        mkdir -p "$root$(dirname -- "$library")"
        cp -L -- "$library" "$root$library"
    done < <(ldd "$stage/bin/lightprobe" | sed -n 's/^\(.* => \)\?[[:space:]]*\(\/[^ ]*\) (.*/\2/p' | grep -v "/$name/" | sort -u)
    # The loader finds what lies beside a program by /proc.
    mkdir -p "$root/proc"
    # shellcheck disable=SC2016
    unshare --map-root-user --mount bash -c 'mount --rbind /proc "$1/proc" && exec chroot "$1" "${@:2}"' bash "$root" \
        "/$name/bin/lightprobe" bake "/$name/scenes/cornell.glb" -q --set grid.divisions='(3,3,3)' -o /tmp/cornell.probes \
        >"$work/own_root.txt" 2>&1
}

"$stage/bin/lightprobe" --version >/dev/null
env -i "$stage/bin/lightprobe" bake scenes/cornell.glb -q --set grid.divisions='(3,3,3)' -o "$work/cornell.probes" >/dev/null ||
    die 'the archive does not run in an empty environment'
if try_in_own_root; then
    say 'runs in a root folder that holds nothing but the archive, libc, libm, libstdc++ and libgcc_s'
else
    say "no root folder of its own could be tried here: $(tail -n 1 "$work/own_root.txt")"
fi
rm -rf -- "$work/root" "$work/own_root.txt"
python3 -m venv "$work/venv" >/dev/null 2>&1 && "$work/venv/bin/pip" install --quiet --no-index "$wheel" &&
    env -i "$work/venv/bin/lightprobe" --version >/dev/null &&
    check_libraries "$work/venv/bin/lightprobe" "$(cd "$work/venv" && pwd -P)" && say 'the wheel installs and runs' ||
    say 'the wheel could not be tried (python3-venv is missing, or pip refused it)'
rm -rf -- "$work/venv"

start_ms=$(python3 - "$stage/bin/lightprobe" <<'PY'
import statistics, subprocess, sys, time

def start():
    before = time.perf_counter()
    subprocess.run([sys.argv[1], "--version"], stdout=subprocess.DEVNULL, check=True)
    return 1000 * (time.perf_counter() - before)

print(f"{statistics.median(start() for _ in range(11)):.0f}")
PY
)
du -h --apparent-size "$work/$name.tar.gz" "$wheel" "$stage/bin/lightprobe" "$stage"/lib/*
printf 'start: %s ms, glibc %s or newer\n' "$start_ms" "$glibc"
