# shellcheck shell=bash
# Shared by all scripts here: messages, and a usable environment even when none was given.
# Sourced, never run. Sets `root` (the checkout) and makes it the current folder.

set -euo pipefail

root=$(CDPATH='' cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.." && pwd -P)
deps=$root/.deps

say() { printf '%s: %s\n' "${0##*/}" "$*" >&2; }

die() {
    printf '%s: error: %s\n' "${0##*/}" "$*" >&2
    exit 2
}

# No script here takes arguments beyond --help: print the text on --help, refuse anything else.
only_help() { # TEXT ARGUMENTS...
    local text=$1
    shift
    [[ $# -gt 0 ]] || return 0
    case $1 in
        -h | --help) printf '%s\n' "$text" && exit 0 ;;
        *) die "unknown argument '$1'; see --help" ;;
    esac
}

# An unset PATH is not empty: bash makes one up, does not hand it to its children, and ends it with '.'.
ensure_path() {
    [[ $(declare -p PATH 2>/dev/null) == 'declare -x'* ]] && return
    export PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin
}

passwd_home() { (getent passwd "$(id -u)" 2>/dev/null || true) | cut -d: -f6; }

ensure_home() {
    [[ -n ${HOME-} ]] && return
    HOME=$(passwd_home)
    export HOME=${HOME:-/}
}

# cargo from PATH, else from where rustup and the official container images put it.
find_cargo() {
    local home
    type -P cargo >/dev/null && return
    for home in "${CARGO_HOME-}" "$HOME/.cargo" "$(passwd_home)/.cargo" /usr/local/cargo; do
        if [[ -n $home && -x $home/bin/cargo ]]; then
            export PATH=$PATH:$home/bin
            return
        fi
    done
    die "cargo is not on PATH nor in $HOME/.cargo/bin: install Rust (rustup) and run this again"
}

# rustup's cargo is a proxy that looks for its toolchains in $HOME; when they are not there, they are beside it.
find_toolchains() {
    local bin home
    if [[ -z ${RUSTUP_HOME-} && ! -d $HOME/.rustup ]]; then
        bin=$(dirname -- "$(type -P cargo)")
        for home in "$bin/../../.rustup" "$bin/../../rustup"; do
            [[ -d $home/toolchains ]] && RUSTUP_HOME=$(CDPATH='' cd -- "$home" && pwd -P) && export RUSTUP_HOME && break
        done
    fi
    # Another user's rustup would fail on trying to update itself there before it runs anything.
    [[ -w ${RUSTUP_HOME:-$HOME/.rustup} ]] || export RUSTUP_AUTO_INSTALL=${RUSTUP_AUTO_INSTALL:-0}
}

# cargo keeps what it downloads in its home. A service account has none that it can write to.
ensure_cargo_home() {
    [[ -z ${CARGO_HOME-} ]] || return 0
    if [[ -d $HOME/.cargo ]]; then
        [[ -w $HOME/.cargo ]] && return
    elif [[ -d $HOME && -w $HOME ]]; then
        return
    fi
    export CARGO_HOME=$deps/cargo
}

# For whatever calls cargo; setup.sh's own run of this does not reach its caller.
ensure_cargo() {
    find_cargo
    find_toolchains
    ensure_cargo_home
}

# Sets `lightprobe`: the binary that LIGHTPROBE names, else a release build of this checkout, with set-up first.
provide_lightprobe() {
    if [[ -n ${LIGHTPROBE-} ]]; then
        lightprobe=$LIGHTPROBE
        [[ -x $lightprobe ]] || die "LIGHTPROBE=$LIGHTPROBE is no program: correct or unset it"
        return
    fi
    bash scripts/setup.sh
    ensure_cargo
    say 'building (the first time takes minutes)'
    # cargo says where the binary is, whatever CARGO_TARGET_DIR and its configuration make of it.
    lightprobe=$(cargo build --locked --release --bin lightprobe --message-format=json-render-diagnostics |
        sed -n 's/.*"executable":"\([^"]*\)".*/\1/p' | tail -n 1) || die 'the build failed; cargo says above why'
    [[ -x $lightprobe ]] || die "cargo built no lightprobe ('$lightprobe')"
}

# Relative folders in variables mean the caller's folder, which we are about to leave.
anchor_folders() {
    local name
    for name in CARGO_TARGET_DIR EMBREE_DIR LIBCLANG_PATH LIGHTPROBE; do
        case ${!name-} in
            '' | /*) ;;
            *) export "$name=$PWD/${!name}" ;;
        esac
    done
}

ensure_path
ensure_home
anchor_folders
cd -- "$root"
