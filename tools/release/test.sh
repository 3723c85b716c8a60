#!/usr/bin/env bash
# Tests that a release can be built, with programs that are built already.
#
# Usage: test.sh PROGRAMS OUT [OPTIONS of build.sh]
set -euo pipefail

here=$(realpath "$(dirname "$0")")
out=$(realpath -m "$2")
"$here/build.sh" -o "$out" --programs "$1" "${@:3}" >/dev/null
unpacked=$(mktemp -d)
trap 'rm -rf "$unpacked"' EXIT

cd "$out"
sha256sum --check --quiet SHA256SUMS
[ "$(wc -l <SHA256SUMS)" = 3 ]
for file in *.tar.gz; do
    tar -xzf "$file" -C "$unpacked"
done

cd "$unpacked"/wavesplat-*-linux
for program in wavesplat wavesplat-render; do
    "./$program" --version
    for file in "man/$program.1" "completions/$program".{bash,zsh,fish}; do
        grep -q "$program" "$file"
    done
done
for file in README.md LICENSE-MIT LICENSE-APACHE font-licence.txt; do
    [ -s "$file" ]
done

# All crates that any feature needs are there, with their checksums.
cd "$unpacked"/wavesplat-*-sources
CARGO_HOME=$unpacked/cargo cargo metadata --offline --locked --all-features --format-version 1 >/dev/null
