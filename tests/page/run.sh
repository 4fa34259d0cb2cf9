#!/usr/bin/env bash
# run.sh PROGRAM [arguments of drive.py]: the page of `ivd serve` in Chromium, which is installed where there is none.
set -euo pipefail
program=$(realpath "$1")
shift
cd "$(dirname "$0")/../.."
if ! command -v chromium >/dev/null && ! command -v google-chrome >/dev/null; then
    as_root=$([ "$(id -u)" = 0 ] || echo sudo)
    export DEBIAN_FRONTEND=noninteractive
    for try in 1 2 3; do
        if $as_root apt-get update -qq && $as_root apt-get install -y -qq --no-install-recommends chromium >/dev/null; then break; fi
        [ "$try" != 3 ] || { echo "Chromium can't be installed"; exit 1; }
        sleep 10
    done
fi
python=target/page-venv/bin/python
[ -x "$python" ] || python3 -m venv target/page-venv
"$python" -c 'import websocket' 2>/dev/null || target/page-venv/bin/pip install -q --disable-pip-version-check 'websocket-client==1.9.0'
"$python" tests/page/drive.py "$program" "$@"
