#!/usr/bin/env bash
# Runs fuzz targets one after the other: `fuzz/run.sh [TARGET|all] [SECONDS]`, a minute each where nothing is said.
# Prints a line a target: executions, edges covered, crashes. Fails where one crashed. Logs go to fuzz/artifacts.
# TOOLCHAIN names another compiler than nightly, SANITIZER=none builds without the address sanitizer.
set -uo pipefail
cd "$(dirname "$0")"

target=${1:-all} seconds=${2:-60}
toolchain=${TOOLCHAIN:-nightly} sanitizer=${SANITIZER:-address}
targets=$target
[ "$target" = all ] && targets=$(sed -n 's|^path = "fuzz_targets/\(.*\)\.rs"|\1|p' Cargo.toml)

failed=0
for t in $targets; do
    log=artifacts/$t.log
    mkdir -p artifacts "artifacts/$t" "corpus/$t"
    options=(-max_total_time="$seconds" -timeout=60 -rss_limit_mb=1024 -malloc_limit_mb=512 -max_len=8192 -print_final_stats=1)
    [ -f "dictionaries/$t.dict" ] && options+=(-dict="dictionaries/$t.dict")
    cargo "+$toolchain" fuzz run -s "$sanitizer" "$t" "corpus/$t" "seeds/$t" -- "${options[@]}" >"$log" 2>&1
    status=$?
    executions=$(sed -n 's/^stat::number_of_executed_units: *//p' "$log" | tail -1)
    edges=$(grep -o 'cov: [0-9]*' "$log" | tail -1)
    crashes=$(find "artifacts/$t" -type f | wc -l)
    echo "$t: ${executions:-0} executions, edges ${edges#cov: }, $crashes crash files, exit $status"
    [ $status -eq 0 ] || failed=1
done
exit $failed
