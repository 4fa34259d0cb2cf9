"""Figures of reports held against --json: python reports.py PATH/TO/ivd OUT SCENE…

Runs each scene with a report, reads every figure that the page marks (`data-figure`, `data-value`) and finds it in what `--json` tells; and
each page says what was asked (every handle's pick, move and radius) and has no name of a folder. Pages stay in OUT/NAME to be looked at.
Prints `N passed, N failed`; the exit code is 1 where something failed.
"""

import html
import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

from checks import check, outcome

FIGURE = re.compile(r"data-figure='([^']*)' data-value='([^']*)'")


def figure(stages, key):
    """The figure that a page calls STAGE.KEY."""
    name, *keys = key.split(".")
    found = next(stage["metrics"] for stage in stages if stage["stage"] == name)
    for part in keys:
        found = found[int(part)] if isinstance(found, list) else found[part]
    return found


def check_scene(program, out, scene):
    name = scene.stem
    folder = out / name
    words = [program, "pipeline", scene, "--out", folder, "--set", "output.report=true", "--json", "--progress", "never"]
    done = subprocess.run(list(map(str, words)), capture_output=True, text=True)
    check(f"{name}: runs", done.returncode == 0, done.stderr[-500:])
    if done.returncode != 0:
        return
    told = json.loads(done.stdout)
    page = (folder / "report.html").read_text()
    marked = [(html.unescape(key), json.loads(html.unescape(value))) for key, value in FIGURE.findall(page)]
    check(f"{name}: figures on the page", len(marked) >= 12, len(marked))
    for key, value in marked:
        try:
            check(f"{name}: {key}", figure(told["stages"], key) == value, value)
        except (KeyError, IndexError, StopIteration, ValueError) as error:
            check(f"{name}: {key}", False, repr(error))
    text = html.unescape(re.sub(r"<[^>]*>", " ", page))
    for i, handle in enumerate(tomllib.loads(scene.read_text()).get("deform", {}).get("handle", [])):
        for key in ("pick", "move"):
            if isinstance(handle.get(key), list):
                asked = ", ".join(f"{c:g}" for c in handle[key])
                check(f"{name}: handle {i} says its {key}", asked in text, asked)
    check(f"{name}: no folder is named", str(scene.resolve().parent) not in page)
    print(f"{name}: {len(marked)} figures", flush=True)


if __name__ == "__main__":
    program, out, *scenes = sys.argv[1:]
    for path in scenes:
        check_scene(program, Path(out), Path(path))
    sys.exit(outcome())
