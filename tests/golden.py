"""golden.py PROGRAM [SCENE ...] [--check TABLE | --write TABLE] [--keep FOLDER]: what the scenes of fixtures/scenes come to.

Runs every scene whose input is there (or those named) and prints a line, tab-separated, for
- every artefact: scene, stage, variant, kind, content hash;
- every output: scene, "output", name, file, hash of what the file says: a volume's or a displacement field's values and
  geometry, a mesh's vertices and triangles, a picture's pixels. A report has a line for each of its sections: tables,
  charts and pictures, without times and memory.
A file's bytes don't count, so another compression or order of metadata moves nothing.

--check compares with a table instead and fails on any line that differs, is missing or is new; --write makes the table anew
and keeps its lines of scenes that weren't run. --keep leaves the outputs in a folder for each scene. Needs the packages of tests/interop/requirements.txt.
"""
import argparse, base64, contextlib, hashlib, html.parser, json, pathlib, subprocess, sys, tempfile, tomllib

import nibabel as nib
import nrrd
import numpy as np
import SimpleITK as sitk
import trimesh

SCENES = pathlib.Path(__file__).resolve().parents[1] / "fixtures" / "scenes"


def digest(*parts):
    """SHA-256 of arrays (type, shape, values) and of whatever else has a repr."""
    state = hashlib.sha256()
    for part in parts:
        if isinstance(part, np.ndarray):
            part = np.ascontiguousarray(part, part.dtype.newbyteorder("<"))
            state.update(f"{part.dtype.str} {part.shape}\n".encode() + part.tobytes())
        else:
            state.update(f"{part!r}\n".encode())
    return state.hexdigest()


def pixels(file):
    return sitk.GetArrayFromImage(sitk.ReadImage(file))


def nifti(file):
    image = nib.load(file)
    fields = ["pixdim", "xyzt_units", "qform_code", "sform_code", "quatern_b", "quatern_c", "quatern_d",
              "qoffset_x", "qoffset_y", "qoffset_z", "srow_x", "srow_y", "srow_z"]
    scaling = [float(image.dataobj.slope), float(image.dataobj.inter)]
    return digest(image.dataobj.get_unscaled(), scaling, *(image.header[field] for field in fields))


def nrrd_field(file):
    values, header = nrrd.read(str(file))
    geometry = [header.get(field) for field in ("space", "kinds", "space units")]
    return digest(values, geometry, *(header[field] for field in ("space directions", "space origin")))


def mesh(file):
    """Corners of the triangles, and every property of the vertices: places, and where on the grid they were cut."""
    read = trimesh.load(file, process=False)
    vertices = read.metadata["_ply_raw"]["vertex"]["data"]
    return digest(np.asarray(read.faces), *(part for name in vertices.dtype.names for part in (name, vertices[name])))


class Report(html.parser.HTMLParser):
    """The sections of a report: of each, lines with what it shows."""

    # Columns that say what the run took.
    TAKEN = {"wall [s]", "processor [s]", "peak memory [MiB]"}
    # Elements whose text isn't shown, or tells the program's version.
    SILENT = {"script", "style", "foot"}

    def __init__(self, text):
        super().__init__()
        self.sections = {"pictures": []}
        self.open, self.drawing = [], False
        self.header, self.row, self.all_heads = [], None, True
        self.feed(text)

    def tell(self, line):
        self.sections[list(self.sections)[-1]].append(line)

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        if tag == "img":
            with tempfile.NamedTemporaryFile(suffix=".png") as file:
                file.write(base64.b64decode(attributes["src"].removeprefix("data:image/png;base64,")))
                file.flush()
                self.tell(f"picture {digest(pixels(file.name))}")
        if self.drawing:
            self.tell(f"{tag} {sorted(attributes.items())}")
        if tag == "table":
            self.header = []
        if tag == "tr":
            self.row, self.all_heads = [], True
        if tag in ("th", "td"):
            self.row.append("")
            self.all_heads &= tag == "th"
        if "style" in attributes and self.row:
            self.row[-1] += attributes["style"]
        self.drawing |= tag == "svg"
        self.open.append("foot" if attributes.get("class") == "foot" else tag)

    def handle_endtag(self, tag):
        # Some elements are never closed.
        while self.open and self.open.pop() not in (tag, "foot"):
            pass
        self.drawing &= tag != "svg"
        if tag == "tr":
            self.header = self.header or (self.row if self.all_heads else [])
            named = [self.header[i] if i < len(self.header) else "" for i in range(len(self.row))]
            self.tell(" | ".join(cell.strip() for cell, name in zip(self.row, named) if name not in self.TAKEN))
            self.row = None

    def handle_data(self, text):
        inside = self.open[-1] if self.open else ""
        if inside == "h2":
            self.sections[text] = []
        elif self.row:
            self.row[-1] += text
        elif text.strip() and inside not in self.SILENT:
            self.tell(text.strip())


def report(file):
    return {f"report: {name}": digest(lines) for name, lines in Report(file.read_text()).sections.items()}


READERS = {".nii": nifti, ".nii.gz": nifti, ".nrrd": nrrd_field, ".ply": mesh, ".png": lambda f: digest(pixels(f))}


def lines_of(program, scene, keep):
    """Every line of a scene: what it is of, and the hash."""
    lines = {}
    kept = keep and keep / f"{scene.stem}.part"
    with contextlib.nullcontext(kept) if keep else tempfile.TemporaryDirectory() as out:
        words = [program, "--json", "--quiet", "--cache", "off", "pipeline", scene, "--out", out]
        done = subprocess.run(words, capture_output=True, text=True)
        if done.returncode != 0:
            sys.exit(f"{scene.stem}: exit code {done.returncode}: {done.stderr}")
        said = json.loads(done.stdout)
        # The report is looked at section by section below.
        for stage in said["stages"]:
            if stage["output"] and stage["stage"] != "report":
                of = (scene.stem, stage["stage"], stage.get("variant", ""), stage["output"]["kind"])
                lines[of] = stage["output"]["hash"]
        for output in said["outputs"]:
            file = pathlib.Path(output["path"])
            if file.suffix == ".html":
                found = report(file)
            else:
                found = {output["name"]: READERS["".join(file.suffixes)](file)}
            lines |= {(scene.stem, "output", name, file.name): value for name, value in found.items()}
    if keep:
        # Only of a scene that went well.
        kept.rename(keep / scene.stem)
    return lines


def read_table(file):
    rows = (line.rstrip("\n").split("\t") for line in open(file, encoding="utf-8"))
    return {tuple(of): value for *of, value in rows}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=pathlib.Path)
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help="names in fixtures/scenes; all without one")
    mode = parser.add_mutually_exclusive_group()
    mode.add_argument("--check", type=pathlib.Path, metavar="TABLE")
    mode.add_argument("--write", type=pathlib.Path, metavar="TABLE")
    parser.add_argument("--keep", type=pathlib.Path, metavar="FOLDER")
    args = parser.parse_args()

    now, ran = {}, set()
    for scene in [SCENES / f"{name}.toml" for name in args.scenes] or sorted(SCENES.glob("*.toml")):
        file = tomllib.loads(scene.read_text())["input"].get("file")
        if file and not (SCENES / file).exists():
            print(f"{scene.stem}: passed over, {file} isn't there", file=sys.stderr)
            continue
        ran.add(scene.stem)
        now |= lines_of(args.program.resolve(), scene, args.keep)

    if args.check:
        table = {of: value for of, value in read_table(args.check).items() if of[0] in ran}
        moved = [f"differs  {' '.join(of)}: {table[of]} -> {now[of]}" for of in now if of in table and table[of] != now[of]]
        moved += [f"missing  {' '.join(of)}" for of in table if of not in now]
        moved += [f"new      {' '.join(of)}" for of in now if of not in table]
        print("\n".join(moved + [f"{len(ran)} scenes, {len(now)} lines, {len(moved)} moved"]))
        sys.exit(1 if moved else 0)
    if args.write and args.write.exists():
        now = {of: value for of, value in read_table(args.write).items() if of[0] not in ran} | now
    text = "".join("\t".join((*of, value)) + "\n" for of, value in sorted(now.items(), key=lambda line: line[0][0]))
    if args.write:
        args.write.write_text(text)
    else:
        print(text, end="")


main()
