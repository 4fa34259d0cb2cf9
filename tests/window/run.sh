#!/usr/bin/env bash
# run.sh PROGRAM [PICTURE]: the window of `ivd view` on a screen that nobody sees, which is installed where there is none.
set -euo pipefail
if ! command -v Xvfb >/dev/null || ! PATH=$PATH:/sbin:/usr/sbin ldconfig -p | grep -q libxkbcommon-x11; then
    as_root=$([ "$(id -u)" = 0 ] || echo sudo)
    export DEBIAN_FRONTEND=noninteractive
    for try in 1 2 3; do
        if $as_root apt-get update -qq && $as_root apt-get install -y -qq --no-install-recommends xvfb libx11-xcb1 libxcursor1 libxi6 libxkbcommon-x11-0 libxrandr2 >/dev/null; then break; fi
        [ "$try" != 3 ] || { echo "Xvfb can't be installed"; exit 1; }
        sleep 10
    done
fi
python3 "$(dirname "$0")/start.py" "$@"
