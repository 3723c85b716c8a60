#!/usr/bin/env bash
# Builds the files of a release:
#
#   wavesplat-VERSION-MACHINE-linux.tar.gz   the two programs without dependencies, man pages, completions
#   wavesplat-VERSION-cp310-abi3-*.whl       the Python package and the two programs
#   wavesplat-VERSION-sources.tar.gz         the sources of the last commit and all crates, to build without a network
#   SHA256SUMS
#
# Where something is missing, says what, builds the rest and ends with 1.
set -euo pipefail

usage() {
    cat <<'TEXT'
Usage: tools/release/build.sh [OPTIONS] [archive] [wheel] [sources]

  -o DIR           the folder of the files [default: target/release-files]
  --programs DIR   take the programs of this folder instead of building them
  --profile NAME   the profile of the Python package [default: release, for Linux of 2014 and later]
  --features LIST  features beyond the default ones, of the programs and the Python package [default: exr,zarr]
TEXT
}

root=$(realpath "$(dirname "$0")/../..")
out=$root/target/release-files
programs=
profile=release
features=exr,zarr
parts=()
while (($#)); do
    case $1 in
    -o) out=$(realpath -m "$2") && shift 2 ;;
    --programs) programs=$(realpath "$2") && shift 2 ;;
    --profile) profile=$2 && shift 2 ;;
    --features) features=$2 && shift 2 ;;
    archive | wheel | sources) parts+=("$1") && shift ;;
    -h | --help) usage && exit ;;
    *) usage >&2 && exit 2 ;;
    esac
done
((${#parts[@]})) || parts=(archive wheel sources)
cd "$root"

machine=$(uname -m)
target=$machine-unknown-linux-musl
version=$(sed -n 's/^version = "\(.*\)"/\1/p' Cargo.toml | head -1)
name=wavesplat-$version
licences=(LICENSE-MIT LICENSE-APACHE src/engine/render/annotate/font-licence.txt)
work=$root/target/release-work
rm -rf "$work"
mkdir -p "$out" "$work"

# Says why a part is not made, and ends it.
missing() {
    echo "!! NOT MADE: $1" >&2
    exit 1
}

# Installs programs by pip, in a folder of their own. They are found first from then on.
pip_install() {
    local python=$root/target/release-python
    python3 -m venv "$python" && "$python/bin/pip" install --quiet "$@" ||
        missing "this needs $*, which pip cannot install here"
    PATH=$python/bin:$PATH
}

# Builds the programs, which hold all that they need. zig compiles their C and C++ for musl.
build_programs() {
    [ -z "$programs" ] || return 0
    [ -d "$(rustc --print target-libdir --target "$target" 2>/dev/null)" ] ||
        missing "the programs need the standard library for musl: rustup target add $target"
    pip_install cargo-zigbuild ziglang
    cargo zigbuild --release --locked --features "$features" --target "$target" --target-dir target \
        --bin wavesplat --bin wavesplat-render
    programs=$root/target/$target/release
}

# The date of the last commit, in seconds.
commit_date() {
    git log -1 --format=%ct 2>/dev/null || missing "dates of files need git and a repository"
}

# Puts a folder of the work into a file of its name: the same bytes for the same files.
pack() {
    local date file=$1.tar.gz
    date=$(commit_date)
    tar --sort=name --owner=0 --group=0 --numeric-owner --mode=u=rwX,go=rX --mtime="@$date" -C "$work" -cf - "$1" |
        gzip -n >"$work/$file"
    mv "$work/$file" "$out"
}

archive() {
    rm -f "$out"/wavesplat-*-linux.tar.gz
    build_programs
    local folder=$work/$name-$machine-linux
    mkdir -p "$folder/man" "$folder/completions"
    install -s "$programs/wavesplat" "$programs/wavesplat-render" "$folder"
    cp README.md "${licences[@]}" "$folder"
    "$folder/wavesplat" generate man -o "$folder/man"
    "$folder/wavesplat-render" --generate man >"$folder/man/wavesplat-render.1"
    local shell
    for shell in bash zsh fish; do
        "$folder/wavesplat" generate completions "$shell" >"$folder/completions/wavesplat.$shell"
        "$folder/wavesplat-render" --generate "completions-$shell" >"$folder/completions/wavesplat-render.$shell"
    done
    pack "$(basename "$folder")"
}

# pip puts the files of the wheel's folder of scripts among the commands of the environment.
wheel() {
    rm -f "$out"/wavesplat-*.whl
    build_programs
    local tools=("maturin>=1.9,<2" wheel) linux=(--compatibility linux)
    if [ "$profile" = release ]; then # for Linux of 2014 and later
        tools+=(ziglang)
        linux=(--zig --compatibility manylinux2014)
    fi
    pip_install "${tools[@]}"
    CARGO_TARGET_DIR=$root/target maturin build --quiet --locked --strip --profile "$profile" --features "$features" \
        "${linux[@]}" --manifest-path tools/python/Cargo.toml --out "$work/wheel"
    python -m wheel unpack --dest "$work/unpacked" "$work"/wheel/*.whl
    local folder=("$work"/unpacked/*)
    local inner=$folder/$(basename "$folder")
    install -D -s -t "$inner.data/scripts" "$programs/wavesplat" "$programs/wavesplat-render"
    install -D -m 644 -t "$inner.dist-info/licenses" "${licences[@]}"
    python -m wheel pack --dest-dir "$out" "$folder"
}

sources() {
    rm -f "$out"/wavesplat-*-sources.tar.gz
    local folder=$work/$name-sources
    commit_date >/dev/null
    mkdir -p "$folder/.cargo"
    git archive HEAD | tar -x -C "$folder"
    (cd "$folder" && cargo vendor --locked vendor >.cargo/config.toml 2>../vendor.log) ||
        missing "the sources need all crates, which cargo cannot download here: $(tail -1 "$work/vendor.log")"
    pack "$(basename "$folder")"
}

# The checksums of all files that are there.
checksums() {
    cd "$out"
    shopt -s nullglob
    local files=(wavesplat-*.tar.gz wavesplat-*.whl)
    rm -f SHA256SUMS
    ((!${#files[@]})) || sha256sum -- "${files[@]}" >SHA256SUMS
}

result=0
for part in "${parts[@]}" checksums; do
    "$part" & # an error ends a part, not all of them
    wait $! || result=1
done
rm -rf "$work"
ls -l "$out"
exit "$result"
