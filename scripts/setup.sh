#!/usr/bin/env bash
# Makes `cargo build` work: checks the tools, and provides Embree 4 (to link) and libclang (for embree4-sys's bindgen).
#
#   .deps/embree/    lib/libembree4.so, and `from`: where it came from
#   .deps/libclang/  libclang.so or nothing, and `from`
#   .deps/stamp      what was found good, as sizes and times: an unchanged stamp ends this script at once
#   .cargo/config.toml  LIBCLANG_PATH and the compiler's headers, for cargo's build scripts
#
# `from` is one line: `wheel NAME VERSION SHA256` (unpacked here; SHA256SUMS beside it) or `path FILE` (used where it is).
# Everything is made in .deps/tmp.* and renamed into place, so an interrupted run leaves nothing half-done.

# shellcheck source=scripts/lib.sh
source "$(dirname -- "${BASH_SOURCE[0]}")/lib.sh"

only_help "usage: scripts/setup.sh

Prepares this checkout for cargo. Needs no root, changes nothing outside the checkout, is safe to repeat.

Embree 4 comes from, in this order: EMBREE_DIR, what .deps already holds, the system (pkg-config, the linker's
cache), the PyPI wheel embreex. libclang likewise: LIBCLANG_PATH, .deps, the system, the PyPI wheel libclang.
CXX names the C++ compiler. To choose afresh: rm -rf .deps" "$@"

embree_wheel='embreex 4.4.0.post1 9ee31b8b40a129620e40e06ae5c0af088b12e5f52c583e43428b87a02786d6bb'
libclang_wheel='libclang 18.1.1 c533091d8a3bbf7460a00cb6c1a71da93bffe148f172c7d03b1c31fbf8aa2a0b'
config=.cargo/config.toml
config_mark='# Written by scripts/setup.sh; rewritten when it runs.'
system_dirs=(/usr/local/lib /usr/local/lib64 /usr/lib "/usr/lib/$(uname -m)-linux-gnu" /usr/lib64)
scratch=

# ---- Tools ----------------------------------------------------------------------------------------------------------

check_cargo() {
    local have want
    have=$(cargo --version 2>/dev/null) ||
        die "cargo --version fails ($(cargo --version 2>&1 | head -n 1)): repair the Rust installation (rustup default stable)"
    have=$(cut -d' ' -f2 <<<"$have")
    want=$(sed -n 's/^rust-version *= *"\(.*\)".*/\1/p' Cargo.toml)
    [[ $(printf '%s\n' "$want" "$have" | sort -V | head -n 1) == "$want" ]] ||
        die "cargo is $have, Cargo.toml needs $want or newer: run 'rustup update stable'"
}

# A real compilation, since a compiler may be installed without its library. Sets `cxx`.
check_compiler() {
    local source=$scratch/cxx17.cpp
    cat >"$source" <<'CPP'
#include <optional>
#include <string_view>
template <class T> constexpr bool is_text() { if constexpr (sizeof(T) > 1) return false; else return true; }
int main() { std::optional<std::string_view> text("x"); return is_text<char>() && text->size() == 1 ? 0 : 1; }
CPP
    for cxx in ${CXX:+"$CXX"} g++ clang++ c++; do
        type -P "$cxx" >/dev/null && "$cxx" -std=c++17 "$source" -o "$scratch/cxx17" 2>"$scratch/cxx17.log" && break
        cxx=
    done
    [[ -n $cxx ]] || die "no C++17 compiler: none of ${CXX:+CXX=$CXX, }g++, clang++, c++ compiles a C++17 file;" \
        "install one (Debian, Ubuntu: apt install g++)"
    type -P cc >/dev/null || die "no 'cc', which Rust links with: install a C compiler (Debian, Ubuntu: apt install gcc)"
}

# Sets `python`: one that has pip when there is such a one.
check_python() {
    local candidate
    python=
    while read -r candidate; do
        "$candidate" -c 'import sys; sys.exit(sys.version_info < (3, 9))' 2>/dev/null || continue
        python=${python:-$candidate}
        if "$candidate" -m pip --version >/dev/null 2>&1; then
            python=$candidate
            return
        fi
    done < <(type -aP python3 python)
    [[ -n $python ]] || die "no python3 of version 3.9 or newer on PATH: install one (Debian, Ubuntu: apt install python3)"
}

check_tools() {
    check_cargo
    type -P git >/dev/null || die "git is not on PATH: install it (Debian, Ubuntu: apt install git)"
    check_compiler
    check_python
}

# ---- Wheels ---------------------------------------------------------------------------------------------------------

# A python without pip may still carry one for its virtual environments.
ensure_pip() {
    "$python" -m pip --version >/dev/null 2>&1 && return
    { "$python" -m venv --without-pip "$scratch/venv" && "$scratch/venv/bin/python" -m ensurepip; } >/dev/null 2>&1 ||
        die "$python has no pip, which fetches Embree and libclang: install it (Debian, Ubuntu: apt install python3-pip)"
    python=$scratch/venv/bin/python
}

# Downloads PIN for the wheel tags given, checks its hash and unpacks the members under PREFIX, flat, into TO.
unpack_wheel() { # PIN PREFIX TO REMEDY PIP_ARGUMENTS...
    local name version sha256 prefix=$2 to=$3 remedy=$4 reason
    read -r name version sha256 <<<"$1"
    shift 4
    ensure_pip
    say "fetching $name $version from PyPI"
    mkdir -p "$scratch/$name-wheel" "$to"
    # A caller's wish for virtual environments must not stop a download that installs nothing.
    if ! PIP_REQUIRE_VIRTUALENV=0 "$python" -m pip download --quiet --disable-pip-version-check --no-input --retries 2 \
        --no-deps --only-binary=:all: "$@" --dest "$scratch/$name-wheel" "$name==$version" >"$scratch/pip.log" 2>&1; then
        reason=$(grep -v '^ *$' "$scratch/pip.log" | tail -n 1 || true)
        grep -q 'Retrying' "$scratch/pip.log" && reason='the package index does not answer'
        die "cannot download $name $version from PyPI (${reason:-pip failed}): check the network and pip's settings, or $remedy"
    fi
    "$python" -I - "$sha256" "$prefix" "$to" "$scratch/$name-wheel"/*.whl >"$scratch/unpack.log" 2>&1 <<'PY' ||
import hashlib, pathlib, sys, zipfile

sha256, prefix, to, wheel = sys.argv[1:]
found = hashlib.sha256(pathlib.Path(wheel).read_bytes()).hexdigest()
if found != sha256:
    sys.exit(f"its SHA-256 is {found}, not the pinned {sha256}")
with zipfile.ZipFile(wheel) as archive:
    for member in archive.infolist():
        if member.filename.startswith(prefix) and not member.is_dir():
            path = pathlib.Path(to, pathlib.PurePosixPath(member.filename).name)
            path.write_bytes(archive.read(member))
            path.chmod(0o755)
PY
        die "cannot use the wheel of $name $version: $(tail -n 1 "$scratch/unpack.log")"
}

# `from` and the sums of what was unpacked, by which a later run knows it again.
sign() { # FOLDER PIN
    (cd -- "$1" && find . -type f -exec sha256sum {} + >../sums && mv ../sums SHA256SUMS && printf 'wheel %s\n' "$2" >from)
}

# Whether FOLDER holds what its `from` says; a wheel must be the one that is pinned now.
is_whole() { # FOLDER PIN
    local kind what
    [[ -f $1/from ]] && read -r kind what <"$1/from" || return 1
    case $kind in
        wheel) [[ $what == "$2" ]] && (cd -- "$1" && sha256sum --status --check SHA256SUMS 2>/dev/null) ;;
        path) [[ -f $what ]] ;;
        *) return 1 ;;
    esac
}

swap_in() { # NAME
    [[ ! -e $deps/$1 && ! -L $deps/$1 ]] || mv -T -- "$deps/$1" "$scratch/$1.old"
    mv -T -- "$scratch/$1" "$deps/$1"
}

# ---- Embree ---------------------------------------------------------------------------------------------------------

# Links a program with FOLDER/libembree4.so and runs it: the only proof that the library, and its TBB, are there and fit.
probe_embree() { # FOLDER
    local real version
    real=$(readlink -e -- "$1/libembree4.so") || return 1
    cat >"$scratch/embree.cpp" <<'CPP'
#include <cstdio>
extern "C" {
struct RTCDeviceTy;
RTCDeviceTy *rtcNewDevice(const char *);
long rtcGetDeviceProperty(RTCDeviceTy *, int);
void rtcReleaseDevice(RTCDeviceTy *);
}
int main() {
    RTCDeviceTy *device = rtcNewDevice("threads=1");
    if (!device) return 1;
    std::printf("%ld\n", rtcGetDeviceProperty(device, 0)); // RTC_DEVICE_PROPERTY_VERSION
    rtcReleaseDevice(device);
}
CPP
    # DT_RPATH, as in scripts/build.rs, so that both find the same libraries.
    "$cxx" "$scratch/embree.cpp" -o "$scratch/embree-probe" -L "$1" -lembree4 -Xlinker --disable-new-dtags \
        -Xlinker -rpath -Xlinker "$(dirname -- "$real")" >"$scratch/embree.log" 2>&1 || return 1
    version=$("$scratch/embree-probe" 2>>"$scratch/embree.log") || return 1
    [[ $version == 4???? ]]
}

# The first file in FOLDERS that looks like Embree 4; the development symlink wins over versioned names.
embree_in() { # FOLDERS...
    local folder file
    for folder in "$@"; do
        for file in "$folder"/libembree4.so "$folder"/libembree4.so.* "$folder"/libembree4-*.so*; do
            [[ -f $file ]] && readlink -e -- "$file" && return
        done
    done
    return 1
}

# Uses a library where it is, through a symlink of the name that the linker wants.
adopt_embree() { # FILE
    rm -rf -- "$scratch/embree"
    mkdir -p "$scratch/embree/lib"
    ln -s -- "$1" "$scratch/embree/lib/libembree4.so"
    printf 'path %s\n' "$1" >"$scratch/embree/from"
    probe_embree "$scratch/embree/lib" && swap_in embree
}

system_embree() {
    local folder
    folder=$(pkg-config --variable=libdir embree4 2>/dev/null) && embree_in "$folder" || true
    # The cache lists what the loader finds; the folders, what the linker finds.
    (PATH=$PATH:/usr/sbin:/sbin ldconfig -p 2>/dev/null || true) | sed -n 's/^\tlibembree4\.so.* => //p'
    embree_in "${system_dirs[@]}" || true
}

provide_embree() {
    local file
    if [[ -n ${EMBREE_DIR-} && $EMBREE_DIR != "$deps"/* ]]; then
        file=$(embree_in "$EMBREE_DIR"{,/lib,/lib64,"/lib/$(uname -m)-linux-gnu"}) ||
            die "EMBREE_DIR=$EMBREE_DIR holds no libembree4.so, there or in lib: correct or unset it"
        adopt_embree "$file" || die "EMBREE_DIR=$EMBREE_DIR: $file does not link and run as Embree 4" \
            "($(tail -n 1 "$scratch/embree.log")): correct or unset it"
        return
    fi
    is_whole "$deps/embree" "$embree_wheel" && probe_embree "$deps/embree/lib" && return
    while read -r file; do
        adopt_embree "$file" && return
    done < <(system_embree)
    fetch_embree
}

fetch_embree() {
    local remedy='install Embree 4 and set EMBREE_DIR to its folder'
    [[ $(uname -sm) == 'Linux x86_64' ]] ||
        die "no Embree 4 on this system, and a prebuilt one is pinned for x86-64 Linux only (this is $(uname -sm)): $remedy"
    rm -rf -- "$scratch/embree"
    unpack_wheel "$embree_wheel" embreex.libs/ "$scratch/embree/lib" "$remedy" \
        --python-version 3.12 --platform manylinux_2_28_x86_64
    sign "$scratch/embree" "$embree_wheel"
    ln -s -- "$(cd -- "$scratch/embree/lib" && echo libembree4-*.so.4)" "$scratch/embree/lib/libembree4.so"
    probe_embree "$scratch/embree/lib" ||
        die "the Embree of the wheel does not link and run here ($(tail -n 1 "$scratch/embree.log")): $remedy"
    swap_in embree
}

# ---- libclang -------------------------------------------------------------------------------------------------------

# The compiler's own headers (stddef.h), which the wheel lacks. Last in line, so that a full libclang prefers its own.
clang_arguments() { printf -- '-idirafter%s' "$("$cxx" -print-file-name=include)"; }

# Parses what Embree's headers include: a libclang that loads may still find no stddef.h.
probe_libclang() { # FILE
    [[ -f $1 ]] || return 1
    if [[ ! -x $scratch/libclang-probe ]]; then
        printf '#include <stddef.h>\n#include <sys/types.h>\n#include <stdbool.h>\n' >"$scratch/headers.h"
        cat >"$scratch/libclang.cpp" <<'CPP'
#include <cstdio>
#include <dlfcn.h>
int main(int, char **argv) {
    void *lib = dlopen(argv[1], RTLD_NOW);
    if (!lib) return std::fprintf(stderr, "%s\n", dlerror()), 1;
    auto index = reinterpret_cast<void *(*)(int, int)>(dlsym(lib, "clang_createIndex"));
    auto parse = reinterpret_cast<void *(*)(void *, const char *, const char *const *, int, void *, unsigned, unsigned)>(
        dlsym(lib, "clang_parseTranslationUnit"));
    auto messages = reinterpret_cast<unsigned (*)(void *)>(dlsym(lib, "clang_getNumDiagnostics"));
    if (!index || !parse || !messages) return 1;
    void *unit = parse(index(0, 1), argv[2], argv + 3, 1, nullptr, 0, 0);
    return unit && messages(unit) == 0 ? 0 : 1;
}
CPP
        "$cxx" -std=c++17 "$scratch/libclang.cpp" -o "$scratch/libclang-probe" -ldl >"$scratch/libclang.log" 2>&1 || return 1
    fi
    "$scratch/libclang-probe" "$1" "$scratch/headers.h" "$(clang_arguments)" >"$scratch/libclang.log" 2>&1
}

# What clang-sys would take in FOLDERS. libclang-cpp is another library.
libclangs_in() { # FOLDERS...
    local folder file
    for folder in "$@"; do
        for file in "$folder"/libclang.so "$folder"/libclang-*.so "$folder"/libclang.so.* "$folder"/libclang-*.so.*; do
            [[ -f $file && $file != *-cpp.* ]] && printf '%s\n' "$file"
        done
    done
    return 0
}

system_libclang() {
    local prefix
    prefix=$("${LLVM_CONFIG_PATH:-llvm-config}" --prefix 2>/dev/null) && libclangs_in "$prefix"/{lib,lib64}
    # The newest LLVM first, as clang-sys does; its folders, then the linker's.
    libclangs_in /usr/local/llvm*/lib* /usr/lib/llvm*/lib* /usr/lib64/llvm*/lib* | sort -rV
    libclangs_in "${system_dirs[@]}"
    (PATH=$PATH:/usr/sbin:/sbin ldconfig -p 2>/dev/null || true) | sed -n 's/^\tlibclang[-.][^c].* => //p'
}

adopt_libclang() { # FILE
    probe_libclang "$1" || return 1
    rm -rf -- "$scratch/libclang"
    mkdir -p "$scratch/libclang"
    printf 'path %s\n' "$1" >"$scratch/libclang/from"
    swap_in libclang
}

# The file to hand to bindgen.
libclang_file() {
    local kind='' what=''
    [[ ! -f $deps/libclang/from ]] || read -r kind what <"$deps/libclang/from" || true
    if [[ $kind == path ]]; then echo "$what"; else echo "$deps/libclang/libclang.so"; fi
}

provide_libclang() {
    local file
    if [[ -n ${LIBCLANG_PATH-} && $LIBCLANG_PATH != "$deps"/* ]]; then
        while read -r file; do
            adopt_libclang "$file" && return
        done < <(if [[ -f $LIBCLANG_PATH ]]; then echo "$LIBCLANG_PATH"; else libclangs_in "$LIBCLANG_PATH"; fi)
        die "LIBCLANG_PATH=$LIBCLANG_PATH holds no libclang that works: correct or unset it"
    fi
    is_whole "$deps/libclang" "$libclang_wheel" && probe_libclang "$(libclang_file)" && return
    while read -r file; do
        adopt_libclang "$file" && return
    done < <(system_libclang)
    fetch_libclang
}

fetch_libclang() {
    local remedy='install libclang (Debian, Ubuntu: apt install libclang-dev)'
    [[ $(uname -sm) == 'Linux x86_64' ]] ||
        die "no libclang on this system, and a prebuilt one is pinned for x86-64 Linux only (this is $(uname -sm)): $remedy"
    rm -rf -- "$scratch/libclang"
    unpack_wheel "$libclang_wheel" libclang-18.1.1.data/platlib/clang/native/libclang.so "$scratch/libclang" "$remedy" \
        --platform manylinux2010_x86_64
    sign "$scratch/libclang" "$libclang_wheel"
    probe_libclang "$scratch/libclang/libclang.so" ||
        die "the libclang of the wheel does not work here ($(tail -n 1 "$scratch/libclang.log")): $remedy"
    swap_in libclang
}

# ---- cargo's configuration ------------------------------------------------------------------------------------------

# A path inside the checkout is written relative to it, so that a moved checkout still builds.
config_text() {
    local file
    file=$(libclang_file)
    printf '%s\n\n[env]\n' "$config_mark"
    if [[ $file == "$deps"/* ]]; then
        printf 'LIBCLANG_PATH = { value = "%s", relative = true }\n' "${file#"$root"/}"
    else
        printf "LIBCLANG_PATH = '%s'\n" "$file"
    fi
    printf "BINDGEN_EXTRA_CLANG_ARGS = '%s'\n" "$(clang_arguments)"
}

write_config() {
    config_text >"$scratch/config.toml"
    cmp -s "$scratch/config.toml" "$config" && return
    if [[ -e $config ]] && ! grep -qxF "$config_mark" "$config"; then
        grep -q LIBCLANG_PATH "$config" ||
            die "$config is not ours and sets no LIBCLANG_PATH: add these lines to it:" \
                "$(grep -v '^#' "$scratch/config.toml" | sed '/^$/d' | paste -sd';' | sed 's/;/ ; /g')"
        say "$config is not ours and is left as it is"
        return
    fi
    mkdir -p .cargo
    mv -- "$scratch/config.toml" "$config"
}

# ---- The whole ------------------------------------------------------------------------------------------------------

# All that decides the outcome, cheaply: names, sizes and times instead of contents. Fails when a piece is missing.
fingerprint() {
    local tools
    tools=$(type -P cc g++ clang++ c++ ${CXX:+"$CXX"} python3 git || true)
    printf '%s\n' "$root" "${EMBREE_DIR-}" "${LIBCLANG_PATH-}" "${CXX-}"
    cargo --version && cksum scripts/setup.sh scripts/lib.sh Cargo.toml &&
        stat -L -c '%n %s %y' -- "$deps"/embree/{from,lib/*} "$deps"/libclang/from "$(libclang_file)" "$config" &&
        tr '\n' '\0' <<<"$tools" | xargs -0 stat -L -c '%n %s %y' --
}

is_done() { [[ -f $deps/stamp ]] && cmp -s "$deps/stamp" <(fingerprint 2>/dev/null); }

# One run at a time; what killed runs left behind is cleared away under the lock.
open_scratch() {
    mkdir -p "$deps" 2>/dev/null && [[ -w $deps && -w $root ]] || die "cannot write to $root: set up a checkout of your own"
    if type -P flock >/dev/null; then
        exec 9>"$deps/lock"
        flock -n 9 || { say 'waiting for another setup.sh in this checkout' && flock 9; }
        rm -rf -- "$deps"/tmp.*
    fi
    scratch=$(mktemp -d "$deps/tmp.XXXXXX")
    trap 'rm -rf -- "$scratch"' EXIT
    trap 'exit 130' INT
    trap 'exit 143' TERM HUP
}

describe() { # FOLDER
    local kind name version
    read -r kind name version _ <"$1/from"
    if [[ $kind == wheel ]]; then echo "$name $version (PyPI, in ${1#"$root"/})"; else echo "$name"; fi
}

report() {
    say "ready: Embree from $(describe "$deps/embree"), libclang from $(describe "$deps/libclang")"
    [[ ${CARGO_HOME-} != "$deps/cargo" ]] ||
        say "no home that cargo can write to: before using cargo by hand, export CARGO_HOME=$CARGO_HOME"
}

main() {
    ensure_cargo
    if ! is_done; then
        open_scratch
        if ! is_done; then # another run may have done it while we waited
            check_tools
            provide_embree
            provide_libclang
            write_config
            fingerprint >"$scratch/stamp"
            mv -- "$scratch/stamp" "$deps/stamp"
        fi
    fi
    report
}

main
