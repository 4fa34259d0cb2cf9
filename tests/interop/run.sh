#!/usr/bin/env bash
# run.sh IVD [MEASURE]: what the program writes and reads, held against other people's readers, and what it computes against their code.
# MEASURE is the example of ivd-bench, that beside IVD where it isn't given.
# Needs Python 3; makes a virtual environment under target/ with packages from PyPI.
set -euo pipefail
ivd=$(realpath "${1:?usage: run.sh PATH_OF_IVD [PATH_OF_MEASURE]}")
measure=$(realpath "${2:-$(dirname "$ivd")/examples/measure}")
[ -x "$measure" ] || { echo "$measure is missing: cargo build -p ivd-bench --example measure" >&2; exit 2; }
here=$(cd "$(dirname "$0")" && pwd)
venv=${IVD_INTEROP_VENV:-$here/../../target/interop-venv}
if [ ! -x "$venv/bin/python" ]; then python3 -m venv "$venv"; fi
if ! "$venv/bin/python" -c 'import numpy, nibabel, SimpleITK, nrrd, vtk, tifffile, trimesh, scipy, networkx, blake3, sklearn' 2>/dev/null; then
    "$venv/bin/pip" install -q --disable-pip-version-check -r "$here/requirements.txt"
fi
made=$(mktemp -d)
trap 'rm -rf "$made"' EXIT
status=0
echo "-- golden"
"$venv/bin/python" "$here/../golden.py" "$ivd" --check "$here/../../fixtures/golden.tsv" --keep "$made" || status=1
echo "-- pipeline"
"$venv/bin/python" "$here/pipeline.py" "$ivd" --made "$made" || status=1
echo "-- read_artefact"
"$venv/bin/python" "$here/read_artefact.py" "$here"/../../fixtures/artefacts/*.ivd >/dev/null || status=1
for script in volumes scales fields lattices motions animations transfer_functions; do
    echo "-- $script"
    "$venv/bin/python" "$here/$script.py" "$ivd" || status=1
done
echo "-- label lattices"
"$venv/bin/python" "$here/label_lattices.py" "$ivd" || status=1
echo "-- topology"
"$venv/bin/python" "$here/topology.py" "$ivd" --fields 40 || status=1
echo "-- trees"
"$venv/bin/python" "$here/trees.py" --program "$measure" || status=1
echo "-- mixture"
"$venv/bin/python" "$here/mixture.py" "$measure" || status=1
exit $status
