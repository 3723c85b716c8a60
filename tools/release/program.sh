#!/usr/bin/env bash
# Builds the program for browsers, src/jobs/picture/program.zz, from src/web and all that it uses. Needs rustup, clang and
# python3. Build it anew before a release, and after a change that changes answers: a test of the viewer compares both.
#
#   tools/release/program.sh            writes the file
#   tools/release/program.sh --check    says whether it is what the sources give
set -euo pipefail
cd "$(dirname "$0")/../.."

target=wasm32-unknown-unknown
built=${CARGO_TARGET_DIR:-target}/$target/web/wavesplat_web.wasm
stored=src/jobs/picture/program.zz

rustup target list --installed | grep "$target" >/dev/null || rustup target add "$target"
clang=$(command -v clang || compgen -c clang- | grep -xE 'clang-[0-9]+' | sort -V | tail -1) ||
    { echo 'needs clang' >&2 && exit 1; }

# Paths of this machine have no place in it. All browsers of the last four years have vectors of 128 bits.
export CC_wasm32_unknown_unknown=$clang AR_wasm32_unknown_unknown=${clang%clang*}llvm-ar${clang##*clang}
flags=(-Ctarget-feature=+simd128 "--remap-path-prefix=${CARGO_HOME:-$HOME/.cargo}=cargo" "--remap-path-prefix=$PWD=wavesplat")
CARGO_ENCODED_RUSTFLAGS=$(IFS=$'\x1f' && echo "${flags[*]}") \
    cargo build --profile web --package wavesplat-web --target "$target" --locked

pack='import sys, zlib; sys.stdout.buffer.write(zlib.compress(sys.stdin.buffer.read(), 9))'
unpack='import sys, zlib; sys.stdout.buffer.write(zlib.decompress(sys.stdin.buffer.read()))'
if [[ ${1:-} == --check ]]; then
    python3 -c "$unpack" <"$stored" | cmp - "$built"
else
    python3 -c "$pack" <"$built" >"$stored.part" && mv "$stored.part" "$stored"
fi
