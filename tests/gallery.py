"""Every mode of the renderer on real scans that are deformed, as a page: `python3 tests/gallery.py IVD OUT [NAME …]`.

Each scene is run once for each mode, by one cache, so that only its pictures are made anew. A row of the page is a mode: before, after, and by how much they differ.
"""

import html
import pathlib
import subprocess
import sys
import time

SCENES = pathlib.Path(__file__).resolve().parent / "gallery"
# Scenes: the isovalue of what they show, and the value that is white in a mean.
SCANS = {"ct_head": (500, 900), "mri_head": (60, 300), "mni152": (90, 200), "engine": (100, 110), "bonsai": (40, 90)}
# Air round a body hides what is in it from the least values: boxes inside.
INSIDE = {
    "ct_head": "{min=[-160,-150,-170],max=[-60,-25,-60]}",
    "mri_head": "{min=[-350,-50,440],max=[-260,100,520]}",
    "mni152": "{min=[-40,-60,0],max=[40,40,50]}",
}
# What a row is called, and what is set for it beside the scene's own.
MODES = {
    "Volume, lit, ambient occlusion": ["render.mode=dvr", "render.ao=16"],
    "Volume, pre-integrated": ["render.mode=dvr", "render.classification=pre-integrated", "render.step=1.0"],
    "Volume, unlit": ["render.mode=dvr", "render.shading=false"],
    "Volume, lit, with shadows": ["render.mode=dvr", "render.shadow=true"],
    "Isosurface, ambient occlusion": ["render.mode=iso", "render.iso={iso}", "render.ao=32"],
    "Isosurface with shadows": ["render.mode=iso", "render.iso={iso}", "render.shadow=true"],
    "Maximum intensity": ["render.mode=mip"],
    "Local maximum intensity": ["render.mode=lmip", "render.threshold={iso}"],
    "Attenuated maximum intensity": ["render.mode=attenuated-mip"],
    "Minimum intensity, of a box inside": ["render.mode=minip", "render.clip=[{inside}]"],
    "Mean, like a radiograph": ["render.mode=mean", "render.window=[0,{white}]"],
    "Slices": ["render.mode=slices"],
    "Shear-warp": ["render.mode=shear-warp"],
    "In perspective": ["render.mode=dvr", "render.projection=perspective"],
}
PICTURES = {"before": "Before", "after": "After", "difference": "Difference"}
STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; margin: 2em auto; max-width: 1500px; padding: 0 1em; background: #111; color: #ddd }
h1, h2 { font-weight: 600 } table { border-spacing: 8px } th { text-align: left; font-weight: 400; width: 11em; vertical-align: top }
img { width: 100%; display: block } td { width: 28% } a { color: #8cf } .failed { color: #f96 }
"""


def run(ivd, scene, out, cache, settings):
    """Runs a scene with settings of its own; how long it took, and what went wrong."""
    sets = [part for setting in settings for part in ("--set", setting)]
    command = [ivd, "pipeline", str(scene), "--out", str(out), "--cache", str(cache), "-q", *sets]
    start = time.monotonic()
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        return time.monotonic() - start, done.stderr.strip() or f"exit {done.returncode}"
    return time.monotonic() - start, None


def main():
    ivd, out = sys.argv[1], pathlib.Path(sys.argv[2])
    out.mkdir(parents=True, exist_ok=True)
    sections, failures = [], 0
    for name in sys.argv[3:] or SCANS:
        scene = SCENES / f"{name}.toml"
        title = scene.read_text().splitlines()[0].lstrip("# ")
        rows = []
        iso, white = SCANS[name]
        words = {"iso": iso, "white": white, "inside": INSIDE.get(name)}
        for number, (mode, settings) in enumerate(MODES.items()):
            if words["inside"] is None and any("{inside}" in setting for setting in settings):
                continue
            folder = out / name / f"{number:02}"
            took, problem = run(ivd, scene, folder, out / "cache", [setting.format(**words) for setting in settings])
            print(f"{name}: {mode}: {problem or f'{took:.1f} s'}", flush=True)
            if problem:
                failures += 1
                cells = f'<td colspan="3" class="failed">{html.escape(problem)}</td>'
            else:
                cells = "".join(
                    f'<td><img loading="lazy" alt="{html.escape(f"{title} {mode}: {word}")}" src="{name}/{number:02}/{file}.png"></td>'
                    for file, word in PICTURES.items()
                )
            rows.append(f"<tr><th>{html.escape(mode)}</th>{cells}</tr>")
        heads = "".join(f"<td>{word}</td>" for word in PICTURES.values())
        report = f'<a href="{name}/00/report.html">Report</a>'
        sections.append(f"<h2>{html.escape(title)}</h2><p>{report}</p><table><tr><th></th>{heads}</tr>{''.join(rows)}</table>")
    page = f'<!DOCTYPE html><html lang="en"><meta charset="utf-8"><title>IVD: gallery</title><style>{STYLE}</style><h1>Every mode, on scans that are deformed</h1>{"".join(sections)}</html>'
    (out / "index.html").write_text(page)
    print(out / "index.html")
    sys.exit(1 if failures else 0)


main()
