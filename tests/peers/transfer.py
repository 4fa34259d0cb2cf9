"""transfer.py IVD DATA [--k 3,4,…] [--only NAME,…] [--palette WORD] [--pictures DIR] [--noise]: is a transfer function's picture readable?

Segments real volumes by k-means for each K and makes a transfer function of each, with one set of parameters for all. What rays see is
computed here, from the table in the artefact and the voxels alone, on six views that the program's own rounds don't use: volumes turned in
space and interpolated at 160³ places of a cube about them; a step is the volume's diagonal over 160. A linear ramp over the range (black to
white, opacity from 0 to the greatest) stands beside each.

Columns: classes that are clear, and that are transitions; mean opacity of rays that meet background voxels only; rays that are more than
half opaque and meet no matter, or the reverse, per ray that meets matter (voxels of materials, and those of transitions that lie beyond the
middle between the means of the background and of the nearest material); visibility over what is asked (the smaller of 5 % and half of what a
material would cover alone), of the material where that is least; Kullback-Leibler divergence from the target that the program states;
least CIEDE2000 between colours of materials that touch, over normal vision and three colour blindnesses, and in normal vision; of the pixels
whose right or lower neighbour becomes half opaque in another material, those with CIEDE2000 of 5 or more across two pixels; with
`--noise`, under noise of 5 % of the range, the greatest CIEDE2000 between the colours of a material and of the one that it has more than half of its voxels
in common with (of both together), how many have such a one, and the median over the pixels that are more than half opaque in both pictures;
seconds of the stage. Needs nibabel, numpy and scipy.
"""
import argparse, pathlib, sys, tempfile

import nibabel
import numpy as np
from scipy import ndimage
from scipy.spatial.transform import Rotation

sys.path.insert(0, str(pathlib.Path(__file__).parent))
sys.path.insert(0, str(pathlib.Path(__file__).parents[1] / "interop"))
from read_artefact import read
from surfaces import ivd

RAW = ["--raw-dims", "256,256,113", "--raw-type", "u16", "--raw-spacing", "1,1,2", "--raw-order", "big"]
SCANS = {
    "tooth": ("tooth/tooth.nhdr", []),
    "engine": ("engine/engine.nii.gz", []),
    "bonsai": ("bonsai/bonsai.nii.gz", []),
    "mni152": ("mni152/mni_icbm152_t1_tal_nlin_sym_09a_converted.nii.gz", []),
    "ct_head": ("ct_head_unc", RAW),
    "mri_head": ("mri_head_seg3d/MR.nii.gz", []),
    "vase": ("vase/vase_1comp.vti", []),
    "abdomen": ("ct_abdomen_ts/example_ct.nii.gz", []),
    "crop": ("ct_abdomen_ts/example_ct.nii.gz", []),
}
# Inside the body at every side: voxels of example_ct.
CROP = (slice(34, 88), slice(34, 76), slice(40, 112))
VIEWS = [Rotation.from_euler("zyx", angles, degrees=True) for angles in
         [(20, 10, 0), (110, 15, 5), (200, -10, 10), (290, 20, -10), (35, 70, 0), (40, -65, 15)]]
ALONG = 160


def number(value):
    return np.array(value, dtype=float)


def load(program, folder, data, name):
    file, words = SCANS[name]
    volume = folder / f"{name}.ivd"
    if not volume.exists():
        ivd(program, "import", data / file, *words, "-o", volume)
        if name == "crop":
            whole = nibabel.load(data / file)
            crop = whole.slicer[CROP]
            nibabel.save(crop, folder / "crop.nii")
            ivd(program, "import", folder / "crop.nii", "-o", volume)
    return volume


def arrays(program, folder, artefact):
    """Real values or labels with axes x, y, z, and the spacing."""
    ivd(program, "export", artefact, "-o", folder / "voxels.nii")
    image = nibabel.load(folder / "voxels.nii")
    return np.asarray(image.dataobj), number(image.header.get_zooms()[:3])


def turned(values, spacing, rotation, order, outside):
    """A volume on a cube of ALONG voxels whose last axis is the way of the rays."""
    extent = np.array(values.shape) * spacing
    step = np.linalg.norm(extent) / ALONG
    matrix = np.diag(1 / spacing) @ rotation.as_matrix() * step
    offset = (np.array(values.shape) - 1) / 2 - matrix @ np.full(3, (ALONG - 1) / 2)
    return ndimage.affine_transform(values, matrix, offset, (ALONG,) * 3, order=order, cval=outside), step


def seen(alpha):
    """Visibility of every sample along the last axis, and the opacity of each ray."""
    through = np.cumprod(1 - alpha, axis=2)
    before = np.concatenate([np.ones_like(through[..., :1]), through[..., :-1]], axis=2)
    return before * alpha, 1 - through[..., -1]


def of_step(opacity, exponent):
    return 1 - (1 - np.clip(opacity, 0, 1)) ** exponent


TO_XYZ = number([[.4124564, .3575761, .1804375], [.2126729, .7151522, .0721750], [.0193339, .1191920, .9503041]])


def lab(rgb):
    """L*, a*, b* of linear RGB, along the last axis."""
    xyz = np.clip(rgb, 0, 1) @ TO_XYZ.T / [.95047, 1, 1.08883]
    f = np.where(xyz > 216 / 24389, np.cbrt(xyz), (24389 / 27 * xyz + 16) / 116)
    return np.stack([116 * f[..., 1] - 16, 500 * (f[..., 0] - f[..., 1]), 200 * (f[..., 1] - f[..., 2])], axis=-1)


def ciede2000(x, y):
    (l1, a1, b1), (l2, a2, b2) = np.moveaxis(x, -1, 0), np.moveaxis(y, -1, 0)
    weight = lambda c: np.sqrt(c ** 7 / (c ** 7 + 25 ** 7))
    g = .5 * (1 - weight((np.hypot(a1, b1) + np.hypot(a2, b2)) / 2))
    a1, a2 = a1 * (1 + g), a2 * (1 + g)
    c1, c2 = np.hypot(a1, b1), np.hypot(a2, b2)
    h1, h2 = np.degrees(np.arctan2(b1, a1)) % 360, np.degrees(np.arctan2(b2, a2)) % 360
    grey = c1 * c2 == 0
    turn = np.where(grey, 0, (h2 - h1 + 180) % 360 - 180)
    h = np.where(grey, h1 + h2, (h1 + turn / 2) % 360)
    l, c = (l1 + l2) / 2, (c1 + c2) / 2
    cos = lambda d: np.cos(np.radians(d))
    t = 1 - .17 * cos(h - 30) + .24 * cos(2 * h) + .32 * cos(3 * h + 6) - .2 * cos(4 * h - 63)
    dl = (l2 - l1) / (1 + .015 * (l - 50) ** 2 / np.sqrt(20 + (l - 50) ** 2))
    dc = (c2 - c1) / (1 + .045 * c)
    dh = 2 * np.sqrt(c1 * c2) * np.sin(np.radians(turn / 2)) / (1 + .015 * c * t)
    rotation = -np.sin(np.radians(60 * np.exp(-((h - 275) / 25) ** 2))) * 2 * weight(c)
    return np.sqrt(np.maximum(dl * dl + dc * dc + dh * dh + rotation * dc * dh, 0))


VISIONS = number([[[1, 0, 0], [0, 1, 0], [0, 0, 1]],
                  [[.152286, 1.052583, -.204868], [.114503, .786281, .099216], [-.003882, -.048116, 1.051998]],
                  [[.367322, .860646, -.227968], [.280085, .672501, .047413], [-.011820, .042940, .968881]],
                  [[1.255528, -.076749, -.178779], [-.078411, .930809, .147602], [.004733, .691367, .303900]]])


def touching(labels, materials):
    """Pairs of materials with at least one in a hundred of the foreign faces of one of them between them."""
    n = int(labels.max()) + 1
    faces = np.zeros((n, n), dtype=np.int64)
    for axis in range(3):
        a, b = np.moveaxis(labels, axis, 0)[:-1], np.moveaxis(labels, axis, 0)[1:]
        faces += np.bincount((a.astype(np.int64) * n + b).ravel(), minlength=n * n).reshape(n, n)
    faces += faces.T
    foreign = faces.sum(1) - faces.diagonal()
    return [(a, b) for i, a in enumerate(materials) for b in materials[i + 1:] if faces[a, b] > .01 * min(foreign[a], foreign[b])]


class Looked:
    """Sums over views of what rays see."""

    def __init__(self, count):
        self.by_class, self.alone, self.rays = np.zeros(count), np.zeros(count), 0
        self.background, self.past, self.differ = 0.0, 0, 0
        self.borders, self.edges, self.pictures = 0, 0, []

    def count_edges(self, owner, opacity, colours):
        """Borders between materials in a picture, and those of them that are edges."""
        shown = lab(colours)
        for axis in (0, 1):
            line = lambda of, by: np.moveaxis(of, axis, 0)[by:of.shape[axis] - 2 + by]
            border = (line(owner, 0) != line(owner, 1)) & (line(opacity, 0) > .5) & (line(opacity, 1) > .5)
            border &= (line(owner, 0) >= 0) & (line(owner, 1) >= 0) & (line(opacity, 2) > .5)
            self.borders += border.sum()
            self.edges += (ciede2000(line(shown, 0)[border], line(shown, 2)[border]) >= 5).sum()


def look(values, matter_of, spacing, alpha_of, class_of, materials, most, reference, colour_of=None):
    """Looks at a volume from all views; `class_of`: index of a material by value, or -1."""
    found = Looked(len(materials))
    for rotation in VIEWS:
        value, step = turned(values, spacing, rotation, 1, np.nan)
        voxel, _ = turned(matter_of, spacing, rotation, 0, 0)
        inside = np.isfinite(value)
        exponent = step / reference
        owner = np.where(inside, class_of(np.nan_to_num(value)), -1)
        visible, opacity = seen(np.where(inside, of_step(alpha_of(np.nan_to_num(value)), exponent), 0))
        matter = (voxel > 0).any(axis=2)
        found.rays += matter.sum()
        for i in range(len(materials)):
            mine = owner == i
            found.by_class[i] += visible[mine].sum()
            found.alone[i] += (1 - np.prod(1 - mine * of_step(most, exponent), axis=2))[matter].sum()
        if colour_of is not None:
            half = (np.cumsum(visible, axis=2) > .5).argmax(axis=2)
            met = np.take_along_axis(owner, half[..., None], axis=2)[..., 0]
            colours = np.stack([(visible * c).sum(axis=2) for c in colour_of(np.nan_to_num(value))], axis=-1)
            found.count_edges(met, opacity, colours)
            found.pictures.append(np.where(opacity[..., None] > .5, colours, np.nan))
        past = ~matter & inside.any(axis=2)
        found.background += opacity[past].sum()
        found.past += past.sum()
        found.differ += ((opacity > .5) != matter).sum()
    return found


def judge(values, labels, spacing, transfer, record):
    """The figures of a table and of a ramp beside it."""
    content, table = transfer["content"], np.asarray(transfer["arrays"]["table"]).reshape(-1, transfer["content"]["resolution"], 4)
    figures = record["metrics"]
    hidden = set(figures["background"]) | set(figures["transitions"])
    entries = sorted((e for e in content["entries"] if e["class"] not in hidden), key=lambda e: e["lower"])
    materials = [e["class"] for e in entries]
    low, high = content["range"]
    axis = np.linspace(low, high, content["resolution"])
    middles = np.array([(a["upper"] + b["lower"]) / 2 for a, b in zip(entries, entries[1:])])
    alpha_of = lambda v: np.interp(v, axis, table[0, :, 3])
    owner = lambda v: np.where(alpha_of(v) > 0, np.searchsorted(middles, v), -1)
    most = record["params"]["max_opacity"]
    mean = {c: float(values[labels == c].mean()) for c in np.unique(labels)}
    outside = [mean[c] for c in figures["background"]]
    matter = np.isin(labels, materials)
    if outside and materials:
        below = all(v < mean[materials[0]] for v in outside)
        edge = (max(outside) + mean[materials[0]]) / 2 if below else (min(outside) + mean[materials[-1]]) / 2
        beyond = values > edge if below else values < edge
        matter |= np.isin(labels, figures["transitions"]) & beyond
    matter = matter.astype(np.uint8)
    colour_of = lambda v: (np.interp(v, axis, table[0, :, c]) for c in range(3))
    found = look(values, matter, spacing, alpha_of, owner, materials, most, content["reference_mm"], colour_of)
    share = found.by_class / max(found.by_class.sum(), 1e-9)
    alone = found.alone / max(found.rays, 1)
    asked = np.minimum(.05, .5 * alone)
    target = number([m["target"] for c in materials for m in figures["visibility"] if m["class"] == c])
    divergence = sum(t * np.log(t / max(s, 1e-9)) for t, s in zip(target, share) if t > 0)
    colour = {e["class"]: number(e["rgb"]) for e in entries}
    pairs = touching(labels, materials)
    apart = lambda visions: min((ciede2000(lab(m @ colour[a]), lab(m @ colour[b])) for a, b in pairs for m in visions), default=np.inf)
    ramp = look(values, matter, spacing, lambda v: most * (v - low) / max(high - low, 1e-9), owner, materials, most, content["reference_mm"])
    ramp_share = ramp.by_class / max(ramp.by_class.sum(), 1e-9)
    least = lambda s: min((a / b for a, b in zip(s, asked) if b > 1e-4), default=np.inf)
    return dict(
        clear=figures["background"], transitions=figures["transitions"], background=found.background / max(found.past, 1),
        silhouette=found.differ / max(found.rays, 1), least=least(share), divergence=divergence,
        blind=apart(VISIONS), normal=apart(VISIONS[:1]), edges=found.edges / max(found.borders, 1), pictures=found.pictures, seconds=record["wall_s"],
        ramp=(ramp.background / max(ramp.past, 1), ramp.differ / max(ramp.rays, 1), least(ramp_share)), colours=colour, share=share)


def under_noise(program, folder, values, spacing, k, palette, plain, plain_labels, plain_pictures):
    """Under noise: the greatest difference between the colours of a material and of its match, matches of materials, and the pixels' median difference."""
    noise = np.random.default_rng(1).normal(0, .05 * (values.max() - values.min()), values.shape)
    # Noise of a scan's own type, so that what its range says stays: values are clipped to it.
    noisy = np.clip(values + noise, values.min(), values.max()).astype(np.float32)
    nibabel.save(nibabel.Nifti1Image(noisy, np.diag([*spacing, 1])), folder / "noisy.nii")
    ivd(program, "import", folder / "noisy.nii", "-o", folder / "noisy.ivd")
    ivd(program, "segment", folder / "noisy.ivd", "--method", "kmvs", "--k", k, "-o", folder / "noisy-labels.ivd")
    record = ivd(program, "atf", folder / "noisy.ivd", folder / "noisy-labels.ivd", "--palette", palette, "-o", folder / "noisy-t.ivd", "--cache", "off")
    labels, _ = arrays(program, folder, folder / "noisy-labels.ivd")
    seen = lambda transfer: [(e["class"], number(e["rgb"])) for e in transfer["content"]["entries"] if e["opacity"] > 0]
    there, changes = seen(read(folder / "noisy-t.ivd")), []
    mine = seen(plain)
    for own, rgb in mine:
        for other, changed in there:
            a, b = plain_labels == own, labels == other
            if (a & b).sum() > .5 * (a | b).sum():
                changes.append(float(ciede2000(lab(rgb), lab(changed))))
    row = judge(noisy, labels, spacing, read(folder / "noisy-t.ivd"), record)
    pixels = [ciede2000(lab(x), lab(y)) for x, y in zip(plain_pictures, row["pictures"])]
    return f"{max(changes, default=np.nan):.1f} ({len(changes)} of {len(mine)}), {np.nanmedian(np.concatenate([p.ravel() for p in pixels])):.1f}"


def main():
    words = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    words.add_argument("program")
    words.add_argument("data", type=pathlib.Path)
    words.add_argument("--k", default="3,4,5,6,7,8")
    words.add_argument("--only", default=",".join(SCANS))
    words.add_argument("--palette", default="auto")
    words.add_argument("--pictures", type=pathlib.Path)
    words.add_argument("--view", default="25,15")
    words.add_argument("--noise", action="store_true")
    given = words.parse_args()
    print("| scan | K | clear | transitions | background | silhouette | least / asked | divergence | ΔE₀₀, any vision | normal | edges | ΔE₀₀ under noise | s | ramp: background, silhouette, least |")
    print("|---|---|---|---|---|---|---|---|---|---|---|---|---|---|")
    params = None
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        for name in given.only.split(","):
            volume = load(given.program, folder, given.data, name)
            values, spacing = arrays(given.program, folder, volume)
            values = values.astype(np.float32)
            for k in map(int, given.k.split(",")):
                label_file, file = folder / "labels.ivd", folder / "transfer.ivd"
                ivd(given.program, "segment", volume, "--method", "kmvs", "--k", k, "-o", label_file)
                record = ivd(given.program, "atf", volume, label_file, "--palette", given.palette, "-o", file, "--cache", "off", "--threads", 2)
                params = record["params"]
                labels, _ = arrays(given.program, folder, label_file)
                row = judge(values, labels, spacing, read(file), record)
                noisy = under_noise(given.program, folder, values, spacing, k, given.palette, read(file), labels, row["pictures"]) if given.noise else "–"
                show = lambda list: " ".join(map(str, list)) or "–"
                ramp = ", ".join(f"{x:.2f}" for x in row["ramp"])
                print(f"| {name} | {k} | {show(row['clear'])} | {show(row['transitions'])} | {row['background']:.3f} | {100 * row['silhouette']:.1f} % | {row['least']:.2f} | {row['divergence']:.3f} | {row['blind']:.1f} | {row['normal']:.1f} | {100 * row['edges']:.0f} % | {noisy} | {row['seconds']:.2f} | {ramp} |", flush=True)
                if given.pictures:
                    given.pictures.mkdir(parents=True, exist_ok=True)
                    picture = given.pictures / f"{name}-{k}.png"
                    ivd(given.program, "render", volume, "--transfer", file, "--size", "400x400", f"--view={given.view}", "-o", picture)
    print("\nParameters of all:", params)


if __name__ == "__main__":
    main()
