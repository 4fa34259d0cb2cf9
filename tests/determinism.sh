#!/usr/bin/env bash
# The same content from every build: runs one small scene with each program given, on 1, 2, 3 and 8 threads, with the
# processor's own instructions and without, 20 times over (RUNS=n for fewer), and compares the content hashes of all stages.
# usage: determinism.sh PROGRAM...
set -euo pipefail
[ $# -gt 0 ] || { echo "usage: determinism.sh PROGRAM..." >&2; exit 2; }
runs=${RUNS:-20}
scene=$(dirname "$0")/scenes/determinism.toml
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
# Stage, variant and content hash of everything that was made, one a line.
hashes='import json,sys
for s in json.load(sys.stdin)["stages"]:
    if s.get("output"): print(s["stage"], s.get("variant", ""), s["output"]["hash"])'
count=0
for program in "$@"; do
    for threads in 1 2 3 8; do
        for simd in "" --no-simd; do
            for _ in $(seq "$runs"); do
                "$program" --json --quiet --cache off --threads "$threads" $simd \
                    pipeline "$scene" --out "$work/out" | python3 -c "$hashes" > "$work/now"
                if [ ! -s "$work/first" ]; then
                    cp "$work/now" "$work/first"
                elif ! diff "$work/first" "$work/now"; then
                    echo "$program with $threads threads ${simd:-and all instructions} gives other bytes" >&2
                    exit 1
                fi
                count=$((count + 1))
            done
        done
    done
    echo "$program: the same bytes"
done
# glibc chooses among instructions too: without AVX2 and FMA its sine, power and logarithm are other code. Elsewhere this
# setting does nothing.
for program in "$@"; do
    GLIBC_TUNABLES=glibc.cpu.hwcaps=-AVX,-AVX2,-FMA,-FMA4,-AVX512F "$program" --json --quiet --cache off --no-simd \
        pipeline "$scene" --out "$work/out" | python3 -c "$hashes" > "$work/now"
    diff "$work/first" "$work/now" || { echo "$program: other bytes with the plain C library" >&2; exit 1; }
    count=$((count + 1))
done
echo "$count runs, $(wc -l < "$work/first") results each, all the same"
