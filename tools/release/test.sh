#!/usr/bin/env bash
# Tests that a release can be built, with programs that are built already.
#
# Usage: test.sh PROGRAMS OUT [OPTIONS of build.sh]
set -euo pipefail

cd "$(dirname "$0")/../.."
programs=$1
out=$2
shift 2
rm -rf "$out"
tools/release/build.sh -o "$out" --programs "$programs" "$@" >/dev/null
cd "$out"
sha256sum --check --quiet SHA256SUMS
[ "$(wc -l <SHA256SUMS)" = 3 ]

tar -xzf wavesplat-*-linux.tar.gz
cd wavesplat-*-linux
for program in wavesplat wavesplat-render; do
    "./$program" --version
    grep -q "$program" "completions/$program.bash" "man/$program.1"
done
[ -s README.md ] && [ -s LICENSE-MIT ] && [ -s LICENSE-APACHE ]
cd ..

# All crates that any feature needs are there, with their checksums.
tar -xzf wavesplat-*-source.tar.gz
cd wavesplat-*-source
CARGO_HOME=$(mktemp -d) cargo metadata --offline --locked --all-features --format-version 1 >/dev/null
cd ..
rm -rf wavesplat-*-linux wavesplat-*-source
