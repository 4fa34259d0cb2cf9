"""What isolating a part first saves: python isolate.py PATH/TO/ivd PATH/TO/DATA

Four scans run twice, with the lattice of everything at a value and with that of one part; the same handle moves both. Prints for each: vertices, bricks
(8³ voxels) that the lattice, the map and the warp looked into, voxels that no stage after the isolation visited, time (s, all stages) and peak memory (MiB).
"""

import argparse
import json
import subprocess
import tempfile
from pathlib import Path

OUT = '[output]\nvolume = "deformed.nrrd"\nlattice = "lattice.ply"\nimages = ["after"]\n[render]\nsize = [256, 256]\n'
SCANS = {
    "tooth: enamel": ("tooth/tooth.nhdr", 1000, "[boundary]\nabove = 1000.0\n", ("-64,-9,128", "0,4,0", 36)),
    "engine: above 180": ("engine/engine.nii.gz", 100, "[boundary]\nabove = 180.0\n", ("-16,103,40", "0,6,0", 40)),
    "bonsai: its pot": ("bonsai/bonsai.nii.gz", 100, '[segment]\nk = 4\n[boundary]\nclass = "densest"\n', ("87,-58,-93", "6,0,0", 48)),
    "mri_head: brain": (
        "mri_head_seg3d/MR.nii.gz",
        60,
        '[boundary]\nmethod = "surface"\ndata = "start"\nseed = [-311.3, 4.2, 472.8]\nradius = 20.0\nopen = 5.0\n',
        ("-330,10,525", "0,0,-6", 40),
    ),
}


def run(program, scan, sections, handle, folder):
    pick, move, radius = handle
    scene = folder / "scene.toml"
    text = f'schema = 1\n[input]\nphantom = "head"\n{sections}[refine]\nlevel = 2\n'
    text += f"[[deform.handle]]\npick = [{pick}]\nmove = [{move}]\nradius = {radius}\n{OUT}"
    scene.write_text(text)
    done = subprocess.run(
        [program, "pipeline", scene, "--input", scan, "--out", folder / "out", "--cache", "off", "--json", "--progress", "never", "--threads", "2"],
        capture_output=True,
        text=True,
    )
    if done.returncode:
        raise SystemExit(f"{scene}: {done.stderr}")
    return [s for s in json.loads(done.stdout)["stages"] if s["state"] == "ran"]


def main():
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("program")
    asked.add_argument("data", type=Path)
    words = asked.parse_args()
    print("| scan | lattice of | vertices | bricks: lattice | map | voxels warped | of all | never visited | s | of that boundary | MiB |")
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for name, (file, iso, part, handle) in SCANS.items():
            for way, sections in (("all", f"[lattice]\niso = {iso}.0\n"), ("the part", part)):
                stages = run(words.program, words.data.resolve() / file, sections, handle, Path(folder))
                of = {(s["stage"], s.get("variant", "")): s for s in stages}
                metrics = lambda stage: of[(stage, "")]["metrics"]
                lattice, moved, warped = metrics("lattice"), metrics("map"), metrics("warp")
                total = warped["voxels_total"]
                bricks = max(lattice["bricks_active"], moved["bricks_touched"])
                never = max(0, total - 512 * bricks)
                boundary = of.get(("boundary", ""), {}).get("wall_s", 0.0)
                print(
                    f"| {name} | {way} | {lattice['vertices']} | {lattice['bricks_active']} | {moved['bricks_touched']} | {warped['voxels_resampled']} "
                    f"| {total} | {100 * never / total:.0f} % | {sum(s['wall_s'] for s in stages):.1f} | {boundary:.1f} | {max(s['peak_rss_mb'] for s in stages):.0f} |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
