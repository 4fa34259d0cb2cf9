#!/usr/bin/env bash
# pack.sh IVD MEASURE SUITE OUT.tar.gz: what a bare machine with a graphics card needs to test and measure it: the program, the example `measure_gpu` and
# the test program of ivd-gpu, stripped, with the loaders that drivers ask for. `just pack-gpu` builds and packs. Debian and its like.
set -euo pipefail
ivd=$(realpath "$1") measure=$(realpath "$2") suite=$(realpath "$3") out=$(realpath -m "$4")
here=$(cd "$(dirname "$0")" && pwd)
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
mkdir -p "$folder/ivd-gpu/lib"
cd "$folder/ivd-gpu"
strip -o ivd "$ivd"
strip -o measure "$measure"
strip -o suite "$suite"
cp "$here/run-gpu.sh" .
# Vulkan's loader, and those that NVIDIA's driver is linked with. What isn't here the other machine must have.
known=$(PATH=$PATH:/sbin:/usr/sbin ldconfig -p)
for name in libvulkan.so.1 libEGL.so.1 libGL.so.1 libGLX.so.0 libGLdispatch.so.0 libOpenGL.so.0; do
    found=$(awk -v name="$name" '$1 == name && /x86-64|AArch64/ && !found { found = $NF } END { print found }' <<<"$known")
    if [ -n "$found" ]; then cp -L "$found" "lib/$name"; else echo "note: $name isn't here to be packed" >&2; fi
done
cd ..
tar -czf "$out" ivd-gpu
bytes=$(stat -c %s "$out")
echo "$out: $((bytes / 1024 / 1024)) MiB"
[ "$bytes" -le $((40 * 1024 * 1024)) ] || { echo "more than 40 MiB" >&2; exit 1; }
