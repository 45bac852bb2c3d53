#!/usr/bin/env bash
# Compares exports in real engines, pixel by pixel, with what `render` makes of them. Not part of test.sh: it needs npm, a newer
# Rust than the rest, and minutes for a first build of Bevy.

# shellcheck source=scripts/lib.sh
source "$(dirname -- "${BASH_SOURCE[0]}")/lib.sh"

only_help "usage: scripts/engines.sh

Sets up, and runs tests/engines on scenes that are baked and exported for each engine:

  three  npm's three 0.187.0 in a headless browser, with WebGL 2 in software. Needs npm and Chromium or Chrome (CHROME).
  bevy   Bevy 0.20.1 without a window, on Vulkan in software. Needs Rust 1.97.1, by rustup if cargo is older, and Mesa's
         lavapipe (Debian, Ubuntu: mesa-vulkan-drivers; without them they are fetched by apt-get download, without root).

What is fetched and built lies in .deps/engines; it is not made again. ENGINES names those to test: 'three bevy'.
LIGHTPROBE_PAGE_SHOTS=DIR keeps pictures, the engine's left and ours right." "$@"

three=0.187.0
rust=1.97.1
own=$root/.deps/engines
engines=${ENGINES:-three bevy}
work=
trap '[[ -z $work ]] || rm -rf "$work"' EXIT

# Sets `work`: a new folder beside what is fetched, so that what is half done is never taken for whole.
new_work() {
    mkdir -p "$own"
    work=$(mktemp -d "$own/fetch.XXXXXX")
}

provide_three() {
    export LIGHTPROBE_THREE=$own/three-$three
    [[ ! -d $LIGHTPROBE_THREE ]] || return 0
    type -P npm >/dev/null || die "npm is not on the path: install Node.js, or leave three out of ENGINES"
    say "fetching three $three"
    new_work
    (cd "$work" && npm pack --silent "three@$three" >/dev/null && tar xzf "three-$three.tgz")
    mv "$work/package" "$LIGHTPROBE_THREE"
}

# Runs cargo of the Rust that Bevy asks for: the one on the path if it is new enough, else rustup's, which goes to .deps.
bevy_cargo() {
    local have
    have=$(cargo --version | cut -d' ' -f2)
    if [[ $(printf '%s\n' "$rust" "${have%%-*}" | sort -V | head -n 1) == "$rust" ]]; then
        cargo "$@"
        return
    fi
    type -P rustup >/dev/null || die "cargo is $have, Bevy needs $rust: update Rust, or leave bevy out of ENGINES"
    (
        export RUSTUP_HOME=$own/rustup RUSTUP_TOOLCHAIN=$rust
        if ! compgen -G "$RUSTUP_HOME/toolchains/$rust-*" >/dev/null; then
            say "fetching Rust $rust" && rustup toolchain install "$rust" --profile minimal --no-self-update >&2
        fi
        cargo "$@"
    )
}

# Vulkan's loader, and a driver that needs no graphics card.
provide_vulkan() {
    local driver libraries
    driver=$(compgen -G '/usr/share/vulkan/icd.d/lvp_icd*.json' | head -n 1) || true
    if [[ -n $driver ]] && ldconfig -p | grep -q 'libvulkan\.so\.1 '; then
        export VK_DRIVER_FILES=$driver VK_ICD_FILENAMES=$driver
        return
    fi
    if [[ ! -d $own/vulkan ]]; then
        type -P apt-get dpkg-deb >/dev/null ||
            die "no Vulkan in software: install Mesa's lavapipe, or leave bevy out of ENGINES"
        say 'fetching mesa-vulkan-drivers'
        new_work
        (
            cd "$work"
            apt-get download -qq -o APT::Sandbox::User="$(id -un)" mesa-vulkan-drivers libvulkan1
            mkdir whole
            for package in *.deb; do dpkg-deb -x "$package" whole; done
            library=$(find "$PWD/whole" -name libvulkan_lvp.so)
            printf '{"file_format_version": "1.0.0", "ICD": {"api_version": "1.3.0", "library_path": "%s"}}\n' \
                "${library/"$PWD/whole"/"$own/vulkan"}" >whole/lavapipe.json
        ) || die "mesa-vulkan-drivers cannot be fetched: install it, or leave bevy out of ENGINES"
        mv "$work/whole" "$own/vulkan"
    fi
    libraries=$(dirname -- "$(find "$own/vulkan" -name libvulkan_lvp.so)")
    export VK_DRIVER_FILES=$own/vulkan/lavapipe.json VK_ICD_FILENAMES=$own/vulkan/lavapipe.json
    export LD_LIBRARY_PATH=$libraries${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}
}

provide_bevy() {
    say "building Bevy (the first time takes minutes)"
    CARGO_TARGET_DIR=$own/bevy bevy_cargo build --locked --manifest-path tests/engines/bevy/Cargo.toml
    export LIGHTPROBE_BEVY=$own/bevy/debug/lightprobe-bevy
    provide_vulkan
}

bash scripts/setup.sh
ensure_cargo
for engine in $engines; do
    case $engine in
        three) provide_three ;;
        bevy) provide_bevy ;;
        *) die "ENGINES names no '$engine': 'three bevy'" ;;
    esac
done
CI=true cargo test --release --test engines
