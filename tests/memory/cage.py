"""cage.py PROGRAM [--size N] [--type u8|u16|i16] [--only NAME ...] [--scene FILE ...] [--work FOLDER] [--no-limits] [--markdown]

How much memory every stage and whole scenes take, and what they do where they may have less. Linux, Python's standard library.

Every command runs once without a limit, is looked at from outside meanwhile (/proc/PID/status, every 2 ms), and then again under limits
that fall by a fifth at a time until one stops it. A line for each:

- voxels: of its volume;
- own: most memory of its own (RssAnon and RssShmem) that was seen from outside, in MiB, and in bytes a voxel beyond 150 MiB;
- told: what `--json` says of the same (`peak_own_mb`), and their ratio;
- resident, told: the same for all that is resident (VmHWM and `peak_rss_mb`), mapped files too;
- least: the lowest limit that it completed at; below, how it ended: exit code, seconds since it passed the limit, and the limit that its message names;
- does: whether it completes at the limit that was named.

With --cgroup FOLDER (a cgroup of version 2 that this user may make groups in, with the memory controller) limits are the kernel's as
well: the command runs in a group whose memory.max is a quarter above its limit, and being killed there is a failure.

Ends with 1 where a ratio is off by more than a tenth, a stopped command doesn't exit with 4 within 10 s of passing its limit, leaves an output or names no
limit, or a named limit doesn't do.
"""
import argparse, json, os, pathlib, re, shutil, subprocess, sys, tempfile, time

MIB = 1 << 20
LEAST = 64  # MiB: smaller limits are held against arrays alone
BETWEEN = 0.002
SCENES = pathlib.Path(__file__).resolve().parents[2] / "fixtures" / "scenes"

# Name, arguments, the output. Words in braces are made before; each is measured as it is made.
STAGES = [
    ("phantom", "phantom head --size {size} --type {type} --noise 0.04 -o {head}", "head"),
    ("phantom, no noise", "phantom head --size {size} --type {type} --noise 0 -o {clean}", "clean"),
    ("import", "import {nii} -o {imported}", "imported"),
    ("segment kmvs", "segment {head} --method kmvs --k 4 -o {labels}", "labels"),
    ("segment kmvs, places", "segment {head} --method kmvs --k 6 --spatial-weight 1.5 --max-iterations 3 -o {kplaces}", "kplaces"),
    ("segment emvs", "segment {head} --method emvs --k 4 -o {emvs}", "emvs"),
    ("segment msvs", "segment {head} --method msvs -o {msvs}", "msvs"),
    ("segment hvs, single", "segment {head} --method hvs --linkage single --k 6 -o {single}", "single"),
    ("segment hvs, Ward", "segment {clean} --method hvs --k 6 -o {ward}", "ward"),
    ("segment threshold", "segment {head} --method threshold --values 40,90 -o {bands}", "bands"),
    ("atf", "atf {head} {labels} -o {transfer}", "transfer"),
    ("boundary", "boundary {head} --labels {labels} --class densest -o {part}", "part"),
    ("lattice", "lattice {head} --iso {iso} -o {lattice}", "lattice"),
    ("refine decimate", "refine {lattice} --method decimate --ratio 0.2 -o {decimated}", "decimated"),
    ("refine loop", "refine {lattice} --method loop --level 1 -o {looped}", "looped"),
    ("refine", "refine {lattice} --method collapse --level 2 -o {coarse}", "coarse"),
    ("octree", "octree {coarse} -o {octree}", "octree"),
    ("deform", "deform {coarse} --handle pick={x},{top},{x};move=0,-6,0;radius={r} -o {motion}", "motion"),
    ("deform projective", "deform {coarse} --solver projective --handle pick={x},{top},{x};move=0,-6,0;radius={r} -o {sprung}", "sprung"),
    ("map", "map {coarse} {octree} {motion} -o {field}", "field"),
    ("map biharmonic", "map {coarse} {octree} {motion} --method biharmonic -o {smooth}", "smooth"),
    ("map fem", "map {coarse} {octree} {motion} --method fem -o {elastic}", "elastic"),
    ("space", "space {head} --step kind=cut;centre={x},{x},{x};normal=0,0,1;radius={r};open=8 -o {opened}", "opened"),
    ("warp", "warp {head} {field} -o {deformed}", "deformed"),
    ("combine", "combine {head} {deformed} --op union -o {both}", "both"),
    ("clip", "clip {deformed} --plane point={x},{x},{x};normal=0,0,1 -o {half}", "half"),
    ("render", "render {head} --transfer {transfer} -o {picture}", "picture"),
    ("export", "export {deformed} -o {file}", "file"),
]

SCENE = """schema = 1
[input]
file = "{file}"
[lattice]
iso = {iso}.0
[refine]
level = 2
[[deform.handle]]
pick = [{x}.0, {top}.0, {x}.0]
move = [0.0, -6.0, 0.0]
radius = {r}.0
[output]
images = ["before", "after", "difference"]
volume = "deformed.nii.gz"
report = true
"""


class Seen:
    """What a command took and how it ended."""

    def __init__(self, code, after, anon, resident, out, err):
        self.code, self.after, self.own, self.resident, self.err = code, after, anon / 1024, resident / 1024, err
        try:
            self.told = json.loads(out)
        except ValueError:
            self.told = {}

    def named(self):
        """The limit (MiB) that a message names, if it names one."""
        found = re.search(r"--memory-limit (\d+)MiB", self.err)
        return int(found.group(1)) if found else None


def watch(argv, group=None, limit=None):
    """Runs a command and looks at its memory until it ends; `after`: seconds since it passed a limit (MiB), or since it began."""
    enter = None
    if group:
        enter = lambda: (group / "cgroup.procs").write_text(str(os.getpid()))
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        start = time.monotonic()
        child = subprocess.Popen(argv, stdout=out, stderr=err, preexec_fn=enter)
        anon = resident = 0
        passed = start
        with open(f"/proc/{child.pid}/status") as status:
            while child.poll() is None:
                status.seek(0)
                try:
                    lines = dict(line.split(":", 1) for line in status.read().splitlines())
                except (OSError, ValueError):
                    break
                number = lambda key: int(lines.get(key, "0 kB").split()[0])
                anon = max(anon, number("RssAnon") + number("RssShmem"))
                if limit and passed == start and anon > limit * 1024:
                    passed = time.monotonic()
                resident = max(resident, number("VmHWM"))
                time.sleep(BETWEEN)
        code = child.wait()
        end = time.monotonic()
        out.seek(0), err.seek(0)
        return Seen(code, end - passed, anon, resident, out.read(), err.read().decode(errors="replace"))


class Cage:
    def __init__(self, args, folder):
        self.args, self.folder, self.bad = args, folder, []

    def command(self, words, limit=None):
        argv = [self.args.program, *words, "--json", "--progress", "never"]
        return argv + (["--memory-limit", f"{limit}MiB"] if limit else [])

    def group(self, limit):
        if not self.args.cgroup:
            return None
        group = pathlib.Path(self.args.cgroup) / "cage"
        group.mkdir(exist_ok=True)
        (group / "memory.max").write_text(str(limit * MIB * 5 // 4))
        return group

    def fail(self, name, what):
        self.bad.append(f"{name}: {what}")

    def measure(self, name, words, voxels, output, clear):
        """A line of the table."""
        clear()
        free = watch(self.command(words))
        if free.code != 0:
            self.fail(name, f"exit {free.code} without a limit: {free.err.strip()}")
            return None
        told = {"own": free.told.get("peak_own_mb"), "rss": free.told.get("peak_rss_mb")}
        ratio = told["own"] / free.own if told["own"] else float("nan")
        # Less than the sampling of either side can tell apart.
        if abs(ratio - 1) > 0.1 and abs((told["own"] or 0) - free.own) > 8:
            self.fail(name, f"told {told['own']} MiB of its own, {free.own:.0f} seen")
        row = [name, f"{voxels / 1e6:.1f}", f"{free.own:.0f}", f"{max(0, free.own - 150) * MIB / voxels:.1f}",
               f"{told['own'] or 0:.0f}", f"{ratio:.2f}", f"{free.resident:.0f}", f"{told['rss'] or 0:.0f}"]
        row += self.limits(name, words, free, output, clear) if not self.args.no_limits else []
        show(row, self.args.markdown)
        return free

    def limits(self, name, words, free, output, clear):
        """The lowest limit that does, how the first that doesn't ends, and whether the limit named then does."""
        least, limit = None, max(LEAST, round(free.own * 1.2) + 1)
        while limit >= LEAST:
            clear()
            seen = watch(self.command(words, limit), self.group(limit), limit)
            if seen.code != 0:
                return [f"{least or '–'}"] + self.stopped(name, words, limit, seen, output, clear)
            if seen.own > limit * 1.1 + 16:
                self.fail(name, f"held {seen.own:.0f} MiB under {limit}")
            least, limit = limit, limit * 4 // 5
        return [f"{least or '–'}", "completes at any", "–", "–"]

    def stopped(self, name, words, limit, seen, output, clear):
        if seen.code != 4 or seen.after > 10:
            self.fail(name, f"exit {seen.code} after {seen.after:.1f} s under {limit} MiB: {seen.err.strip()}")
        if output and output.exists():
            self.fail(name, f"an output under {limit} MiB: {output}")
        named, does = seen.named(), "–"
        if named is None:
            self.fail(name, f"no limit named under {limit} MiB: {seen.err.strip()}")
        else:
            clear()
            does = "yes" if watch(self.command(words, named), self.group(named)).code == 0 else "no"
            if does == "no":
                self.fail(name, f"the limit named under {limit} MiB, {named} MiB, doesn't do")
        return [f"{limit}: exit {seen.code} after {seen.after:.1f} s", f"{named or '–'}", does]


HEAD = ["what", "10⁶ voxels", "own (MiB)", "bytes a voxel beyond 150 MiB", "told", "ratio", "resident", "told",
        "least limit", "below it", "names", "does"]


def show(row, markdown):
    print("| " + " | ".join(row) + " |" if markdown else "\t".join(row), flush=True)


def stages(cage):
    args, folder = cage.args, cage.folder
    n, names = args.size, {"size": args.size, "type": args.type, "iso": iso(args.type), "x": args.size // 2, "r": args.size // 4, "top": args.size * 122 // 128}
    for _, words, output in STAGES:
        ending = {"picture": ".png", "file": ".nii.gz"}.get(output, ".ivd")
        names[output] = folder / (output + ending)
    names["nii"] = folder / "head.nii.gz"
    for name, words, output in STAGES:
        wanted = not args.only or any(name.startswith(only) for only in args.only)
        file = names[output]
        words = [word.format(**names) for word in words.split()]
        if name == "import":
            subprocess.run([args.program, "export", names["head"], "-o", names["nii"], "-q"], check=True)
        if wanted:
            made = cage.measure(name, words, n**3, file, lambda: file.unlink(missing_ok=True))
        # A stage that was just stopped has left nothing, and the next ones need it.
        if not file.exists():
            subprocess.run([args.program, *words, "-q", "--progress", "never"], check=False)


def iso(of_type):
    """A value between air and skin, three deviations of the noise above 0: values of other types are those of bytes, made longer."""
    return 30 * 257 if of_type == "u16" else 30


def make_scan(program, n, of_type, noise, scan):
    """A generated head as a file. Of signed words it has the values of bytes: phantoms aren't made of them."""
    run = lambda *words: subprocess.run([program, *map(str, words), "-q"], check=True)
    volume, raw = scan.with_suffix(".ivd"), scan.with_suffix(".raw")
    run("phantom", "head", "--size", n, "--type", "u8" if of_type == "i16" else of_type, "--noise", noise, "-o", volume)
    if of_type == "i16":
        run("export", volume, "-o", raw)
        low = raw.read_bytes()
        words = bytearray(2 * len(low))
        words[0::2] = low
        raw.write_bytes(words)
        run("import", raw, "--raw-dims", f"{n},{n},{n}", "--raw-type", "i16", "--axes", "RAS", "-o", volume)
        raw.unlink()
    run("export", volume, "-o", scan)
    volume.unlink()


def scenes(cage):
    args, folder = cage.args, cage.folder
    n = args.size
    made = []
    # Of the second the surface has a hundred times as many parts: every voxel of the air that the noise raises above the isovalue.
    for name, noise in [("head", "0"), ("head with specks", "0.04")] if not args.scene else []:
        scan = folder / f"{name.replace(' ', '-')}.nii"
        make_scan(args.program, n, args.type, noise, scan)
        made.append(scan.with_suffix(".toml"))
        made[-1].write_text(SCENE.format(file=scan.name, iso=iso(args.type), x=n // 2, r=n // 4, top=n * 122 // 128))
    for scene in [pathlib.Path(s) for s in args.scene] or made:
        out, cache = folder / f"out-{scene.stem}", folder / f"cache-{scene.stem}"

        def clear():
            shutil.rmtree(out, ignore_errors=True)
            shutil.rmtree(cache, ignore_errors=True)

        words = ["pipeline", str(scene), "--out", str(out), "--cache", str(cache)]
        clear()
        subprocess.run([args.program, *words, "--until", "import", "-q", "--progress", "never"], check=True)
        found = next(iter(cache.rglob("*.ivd")))
        facts = json.loads(subprocess.run([args.program, "info", str(found), "--json"], capture_output=True, check=True).stdout)
        dims = find(facts, "dims")
        voxels = dims[0] * dims[1] * dims[2]
        cage.measure(f"scene {scene.stem}", words, voxels, None, clear)
        if args.steps:
            steps(cage, words, clear)


def find(facts, key):
    """The first value of a key, however deep."""
    if isinstance(facts, dict):
        return facts.get(key) or next(filter(None, (find(value, key) for value in facts.values())), None)
    return None


def steps(cage, words, clear):
    """What each part of a scene took, as the program tells it."""
    clear()
    told = watch(cage.command(words)).told
    for part in told.get("stages", []) + told.get("outputs", []):
        name = f"{part.get('stage', part.get('name'))} {part.get('variant', '')}".strip()
        if part.get("state") != "not_needed" and part.get("wall_s"):
            print(f"    {name:24} {part['wall_s']:8.2f} s  own {part.get('peak_own_mb') or 0:7.0f}  resident {part.get('peak_rss_mb') or 0:7.0f}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("--size", type=int, default=128)
    parser.add_argument("--type", default="u8")
    parser.add_argument("--only", nargs="*", default=[])
    parser.add_argument("--scene", nargs="*", default=[])
    parser.add_argument("--work")
    parser.add_argument("--cgroup")
    parser.add_argument("--no-limits", action="store_true")
    parser.add_argument("--no-stages", action="store_true")
    parser.add_argument("--no-scenes", action="store_true")
    parser.add_argument("--steps", action="store_true", help="tell what each part of a scene took")
    parser.add_argument("--markdown", action="store_true")
    args = parser.parse_args()
    args.program = str(pathlib.Path(args.program).resolve())
    with tempfile.TemporaryDirectory(dir=args.work) as folder:
        cage = Cage(args, pathlib.Path(folder))
        head = HEAD[:8] if args.no_limits else HEAD
        show(head, args.markdown)
        if args.markdown:
            show(["---"] * len(head), True)
        if not args.no_stages:
            stages(cage)
        if not args.no_scenes:
            scenes(cage)
    for problem in cage.bad:
        print(f"bad: {problem}", file=sys.stderr)
    return 1 if cage.bad else 0


if __name__ == "__main__":
    sys.exit(main())
