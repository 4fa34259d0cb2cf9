#!/usr/bin/env bash
# run-gpu.sh [SIDE [WIDTH HEIGHT]]: tests and measures this machine's graphics card, from the folder that pack.sh made, without cargo, just, network or files. Volumes
# are generated, by default 512³ pictured at 1920 × 1080. `IVD_ADAPTER` names one of several cards, `IVD_SUITE` a part of the tests, `IVD_ROUNDS` how often pictures are made. Everything that is printed goes to results.txt too.
set -uo pipefail
cd "$(dirname "$0")"
# Mesa's layer that sorts devices asks for a desktop session.
export NODEVICE_SELECT=1
export LD_LIBRARY_PATH="${LD_LIBRARY_PATH:+$LD_LIBRARY_PATH:}$PWD/lib" RUST_BACKTRACE=0
nvidia=/usr/local/nvidia/share/vulkan/icd.d/nvidia_icd.json
if [ -z "${VK_DRIVER_FILES:-}" ] && [ -e "$nvidia" ] && [ ! -e /usr/share/vulkan/icd.d/nvidia_icd.json ]; then
    export VK_DRIVER_FILES=$nvidia
fi
side=${1:-512} width=${2:-1920} height=${3:-1080}
status=0
{
    echo "== doctor"
    ./ivd doctor || status=1
    echo "== suite"
    # That an adapter is expected makes its absence a failure.
    IVD_EXPECT_ADAPTER=${IVD_EXPECT_ADAPTER-} timeout 240 ./suite ${IVD_SUITE:-} --test-threads "${IVD_TEST_THREADS:-4}" || status=1
    echo "== measure"
    timeout 200 ./measure "$side" "$width" "$height" "${IVD_ROUNDS:-10}" || status=1
    echo "== measure, products joined with sums"
    timeout 90 ./measure "$side" "$width" "$height" "${IVD_ROUNDS:-5}" joined || status=1
    exit $status
} 2>&1 | tee results.txt
