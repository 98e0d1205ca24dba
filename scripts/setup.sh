#!/usr/bin/env bash
# Installs what gsii is built with: OpenImageIO, Embree 4, libclang (for bindgen), a C++ compiler, pkg-config.
#
# Debian 13+, Ubuntu 24.04+: everything comes from the distribution.
# Debian 12 packages only Embree 3: there Embree 4 is put under .deps/embree beside the sources and the system is
# left as it is. The library (with the TBB it was built with) comes from the PyPI package embreex4, the headers from
# Debian 13's libembree-dev, which is unpacked but not installed. Both are checked against the sums below.
#
# Needs root or sudo only when packages are missing. Safe to run again: does nothing when all is there.
set -euo pipefail
umask 022
cd "$(dirname "${BASH_SOURCE[0]}")/.."

readonly RUST_MIN=1.89
readonly DEPS=.deps/embree
readonly WHEEL=embreex4==4.4.0.post1
readonly WHEEL_SHA256=ddc6887b38cc742a9ada3b04ce6157ce321c67325bfd9b758854ee0eabd74435
readonly HEADERS=libembree-dev=4.3.3+dfsg-1
readonly HEADERS_SHA256=674a8b3d1a00612f46730da29f4cc146267b4917bbf0242113d0568429e78726
readonly HEADERS_SUITE=trixie

export DEBIAN_FRONTEND=noninteractive LC_ALL=C.UTF-8

say() { printf 'setup: %s\n' "$*"; }
die() { printf 'setup: error: %s\n' "$*" >&2; exit 1; }

installed() { [[ $(dpkg-query -W -f '${db:Status-Status}' "$1" 2>/dev/null) == installed ]]; }

as_root() {
    if [[ $EUID -eq 0 ]]; then "$@"
    elif [[ -t 0 ]]; then sudo --preserve-env=DEBIAN_FRONTEND "$@"
    else sudo -n --preserve-env=DEBIAN_FRONTEND "$@"
    fi </dev/null
}

apt_updated=no
apt_install() {
    [[ $EUID -eq 0 ]] || command -v sudo >/dev/null ||
        die "these packages are missing and there is no sudo; run as root: apt-get install $*"
    if [[ $apt_updated == no ]]; then
        say "reading package lists"
        # One unreachable third-party source must not stop us: the installation itself tells what is missing.
        as_root apt-get -qq update || say "some package lists could not be read; going on"
        apt_updated=yes
    fi
    [[ $# -eq 0 ]] && return
    say "installing $*"
    as_root apt-get -qq -y -o Dpkg::Use-Pty=0 install --no-install-recommends "$@" >/dev/null ||
        die "apt-get could not install: $*"
}

# Major version of Embree that the distribution offers; 0 when it offers none or its lists were never read.
embree_offered() {
    local version
    version=$(apt-cache policy libembree-dev 2>/dev/null | sed -n 's/^ *Candidate: *\([0-9]*:\)\{0,1\}\([0-9]*\).*/\2/p')
    printf '%s' "${version:-0}"
}

# An Embree 4 in the layout that ffi/embree4-sys looks for.
embree_in() { [[ -f $1/include/embree4/rtcore.h && -e $1/lib/libembree4.so ]]; }

embree_ready() {
    if [[ -n ${EMBREE_DIR:-} ]]; then
        [[ -f $EMBREE_DIR/include/embree4/rtcore.h ]] || die "EMBREE_DIR=$EMBREE_DIR has no include/embree4/rtcore.h"
        return 0
    fi
    embree_in "$DEPS" || { installed libembree-dev && [[ -f /usr/include/embree4/rtcore.h ]]; }
}

check_sum() { printf '%s  %s\n' "$2" "$1" | sha256sum --check --status; }

# Debian archives that this machine uses.
mirrors() {
    apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' 'Origin: Debian' 'Label: Debian' 2>/dev/null || true
}

fetch_headers() (
    # apt with its own lists, so that the system's are not mixed with those of another release.
    mkdir -p "$1/lists/partial" "$1/cache/archives/partial"
    cd "$1"
    local mirror
    while read -r mirror; do
        printf 'deb [signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] %s %s main\n' \
            "${mirror%/}" "$HEADERS_SUITE" >sources.list
        local apt=(apt-get -qq
            -o "Dir::Etc::SourceList=$PWD/sources.list" -o Dir::Etc::SourceParts=/dev/null
            -o "Dir::State::Lists=$PWD/lists" -o "Dir::Cache=$PWD/cache"
            -o APT::Sandbox::User=root -o Acquire::Languages=none
            -o Acquire::IndexTargets::deb::DEP-11::DefaultEnabled=false)
        if "${apt[@]}" update && "${apt[@]}" download "$HEADERS" && check_sum libembree-dev_*.deb "$HEADERS_SHA256"; then
            mv libembree-dev_*.deb headers.deb
            exit 0
        fi
        rm -f ./*.deb
    done < <(mirrors | awk '!seen[$0]++')
    exit 1
) </dev/null

install_embree_locally() {
    [[ $(uname -m) == x86_64 ]] ||
        die "no ready-made Embree 4 for $(uname -m) here: build Embree 4.3 or newer yourself and set EMBREE_DIR to where it is installed"
    python3 -m pip --version >/dev/null 2>&1 || apt_install python3-pip
    mkdir -p .deps
    local tmp
    tmp=$(mktemp -d "$PWD/.deps/setup.XXXXXX")
    # shellcheck disable=SC2064  # the folder is known now
    trap "rm -rf '$tmp'" EXIT

    say "fetching Embree 4 headers ($HEADERS)"
    fetch_headers "$tmp/apt" || die "none of this machine's Debian package sources has $HEADERS with its expected SHA-256 sum (suite $HEADERS_SUITE): add one that has to /etc/apt/sources.list, or build Embree 4.3 or newer yourself and set EMBREE_DIR to where it is installed"
    say "fetching the Embree 4 library ($WHEEL)"
    # The library inside does not depend on Python; naming one Python gives every machine the same file.
    python3 -m pip download --quiet --no-deps --only-binary=:all: --implementation cp --python-version 3.11 --abi cp311 \
        --platform manylinux_2_28_x86_64 --dest "$tmp" "$WHEEL" </dev/null || die "pip could not download $WHEEL"
    check_sum "$tmp"/embreex4-*.whl "$WHEEL_SHA256" || die "$WHEEL does not have its expected SHA-256 sum"

    python3 -m zipfile -e "$tmp"/embreex4-*.whl "$tmp/wheel"
    dpkg-deb -x "$tmp/apt/headers.deb" "$tmp/deb"
    # File names and RPATH=$ORIGIN stay as they are: the library finds its TBB beside itself.
    mkdir -p "$tmp/embree/include" "$tmp/embree/lib" "$tmp/embree/licences"
    cp -r "$tmp/deb/usr/include/embree4" "$tmp/embree/include/"
    cp "$tmp"/wheel/embreex4.libs/lib*.so.* "$tmp/embree/lib/"
    chmod 755 "$tmp"/embree/lib/*
    cp "$tmp/deb/usr/share/doc/libembree-dev/copyright" "$tmp/embree/licences/headers"
    cp "$tmp"/wheel/embreex4-*.dist-info/licenses/LICENSE "$tmp/embree/licences/embreex4"
    (cd "$tmp/embree/lib" && ln -s libembree4-*.so.4 libembree4.so)
    rm -rf "$DEPS"
    mv "$tmp/embree" "$DEPS"
    embree_in "$DEPS" || die "the downloaded Embree is incomplete"
    rm -rf "$tmp"
    trap - EXIT
}

check_rust() {
    command -v cargo >/dev/null || die "no Rust here: install Rust $RUST_MIN or newer with rustup (https://rustup.rs), then run this again"
    local have
    have=$(rustc --version | sed -n 's/^rustc \([0-9]*\.[0-9]*\).*/\1/p')
    [[ $(printf '%s\n' "$RUST_MIN" "$have" | sort -V | head -n1) == "$RUST_MIN" ]] ||
        die "rustc $have is too old, $RUST_MIN or newer is needed: rustup update stable"
}

command -v apt-get >/dev/null ||
    die "this script knows Debian and Ubuntu; elsewhere install OpenImageIO 2.4+, Embree 4.3+ (EMBREE_DIR says where), libclang, pkg-config and a C++ compiler"

missing=()
for package in g++ pkg-config libclang-dev libopenimageio-dev; do
    installed "$package" || missing+=("$package")
done
[[ ${#missing[@]} -eq 0 ]] || apt_install "${missing[@]}"

if ! embree_ready; then
    [[ $(embree_offered) -gt 0 ]] || apt_install # a fresh container has no lists yet
    if [[ $(embree_offered) -ge 4 ]]; then
        apt_install libembree-dev
    else
        install_embree_locally
    fi
fi
check_rust
say "ready: cargo build --release"
