#!/usr/bin/env bash
# Builds the files of a release:
#
#   wavesplat-VERSION-MACHINE-linux.tar.gz   the two programs without dependencies, man pages, completions
#   wavesplat-VERSION-cp310-abi3-*.whl       the Python package and the two programs
#   wavesplat-VERSION-source.tar.gz          the sources of the last commit and all crates, to build without a network
#   SHA256SUMS
#
# Where something is missing, says what, builds the rest and ends with 1.
set -euo pipefail

usage() {
    cat <<'TEXT'
Usage: tools/release/build.sh [OPTIONS] [archive] [wheel] [source]

  -o DIR           the folder of the files [default: target/release-files]
  --programs DIR   take the programs of this folder instead of building them
  --profile NAME   the profile of the Python package [default: release, for Linux of 2014 and later]
  --features LIST  further features of the Python package
TEXT
}

cd "$(dirname "$0")/../.."
out=target/release-files
programs=
profile=release
features=
parts=()
while (($#)); do
    case $1 in
    -o) out=$2 && shift 2 ;;
    --programs) programs=$2 && shift 2 ;;
    --profile) profile=$2 && shift 2 ;;
    --features) features=$2 && shift 2 ;;
    archive | wheel | source) parts+=("$1") && shift ;;
    -h | --help) usage && exit ;;
    *) usage >&2 && exit 2 ;;
    esac
done
((${#parts[@]})) || parts=(archive wheel source)

machine=$(uname -m)
target=$machine-unknown-linux-musl
version=$(sed -n 's/^version = "\(.*\)"/\1/p' Cargo.toml | head -1)
name=wavesplat-$version
work=target/release-work
rm -rf "$work"
mkdir -p "$out" "$work"

# Says why a part is not made, and ends it.
missing() {
    echo "!! NOT MADE: $1" >&2
    exit 1
}

# Builds the programs, which hold all that they need.
build_programs() {
    [ -z "$programs" ] || return 0
    [ -d "$(rustc --print target-libdir --target "$target" 2>/dev/null)" ] ||
        missing "the programs need the standard library for musl: rustup target add $target"
    command -v musl-gcc >/dev/null || missing "the programs need musl-gcc, in the package musl-tools of Debian"
    cargo build --release --locked --target "$target" --bin wavesplat --bin wavesplat-render
    programs=target/$target/release
}

archive() {
    build_programs
    local folder=$work/$name-$machine-linux
    mkdir -p "$folder/man" "$folder/completions"
    install -s "$programs/wavesplat" "$programs/wavesplat-render" "$folder"
    cp README.md LICENSE-MIT LICENSE-APACHE "$folder"
    "$folder/wavesplat" generate man -o "$folder/man"
    "$folder/wavesplat-render" --generate man >"$folder/man/wavesplat-render.1"
    local shell
    for shell in bash zsh fish; do
        "$folder/wavesplat" generate completions "$shell" >"$folder/completions/wavesplat.$shell"
        "$folder/wavesplat-render" --generate "completions-$shell" >"$folder/completions/wavesplat-render.$shell"
    done
    pack "$folder"
}

# The files in DIR as OUT/DIR.tar.gz: the same bytes for the same files.
pack() {
    tar --sort=name --owner=0 --group=0 --numeric-owner --mtime="@$(git log -1 --format=%ct)" \
        -C "$(dirname "$1")" -cf - "$(basename "$1")" | gzip -n >"$out/$(basename "$1").tar.gz"
}

# pip puts the files of the wheel's folder of scripts among the commands of the environment.
wheel() {
    build_programs
    local python=target/release-python linux=(--zig --compatibility manylinux2014)
    [ "$profile" = release ] || linux=(--compatibility linux)
    python3 -m venv "$python" && "$python/bin/pip" install --quiet "maturin>=1.9,<2" wheel ziglang ||
        missing "the wheel needs maturin, wheel and ziglang, which pip cannot install here"
    PATH="$PWD/$python/bin:$PATH" CARGO_TARGET_DIR="$PWD/target" "$python/bin/maturin" build --quiet --locked --strip \
        --profile "$profile" --features "$features" "${linux[@]}" --manifest-path tools/python/Cargo.toml --out "$work/wheel"
    "$python/bin/python" -m wheel unpack --dest "$work/wheel" "$work"/wheel/*.whl
    install -D -s -t "$work/wheel/$name/$name.data/scripts" "$programs/wavesplat" "$programs/wavesplat-render"
    "$python/bin/python" -m wheel pack --dest-dir "$out" "$work/wheel/$name"
}

sources() {
    local folder=$work/$name-source
    git rev-parse HEAD >/dev/null || missing "the sources need git and a repository"
    mkdir -p "$folder/.cargo"
    git archive HEAD | tar -x -C "$folder"
    (cd "$folder" && cargo vendor --locked vendor >.cargo/config.toml 2>../vendor.log) ||
        missing "the sources need all crates, which cargo cannot download here: $(tail -1 "$work/vendor.log")"
    pack "$folder"
}

result=0
for part in "${parts[@]}"; do
    "${part/source/sources}" & # an error ends a part, not all of them
    wait $! || result=1
done
(cd "$out" && rm -f SHA256SUMS && sha256sum -- *.tar.gz *.whl 2>/dev/null >SHA256SUMS) || true
rm -rf "$work"
ls -l "$out"
exit "$result"
