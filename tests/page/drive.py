"""drive.py PROGRAM [--chromium FILE] [--pictures FOLDER] [--scene FILE]

The page of `ivd serve` in a headless Chromium, driven as hands would: a drag by mouse, a second tab that watches, Esc in mid-drag, undo, the
keyboard alone, files to keep, and what `ivd pipeline` makes of the scene that was saved. Needs Python's websocket-client.

Ends with 1 at the first thing that doesn't hold.
"""
import argparse, base64, hashlib, http.client, json, os, pathlib, re, shutil, signal, subprocess, sys, tempfile, time

import websocket

SCENE = """schema = 1
[input]
phantom = "head"
size = 64
[lattice]
iso = 40.0
[refine]
level = 1
[output]
images = ["before"]
"""
LONG = 60.0


def check(holds, what):
    if not holds:
        raise SystemExit(f"FAILED: {what}")
    print(f"ok: {what}", flush=True)


class Chromium:
    """A browser without a screen."""

    def __init__(self, program, folder):
        arguments = ["--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run", "--hide-scrollbars",
                     "--window-size=1200,800", f"--user-data-dir={folder}", "--remote-debugging-port=0", "about:blank"]
        self.process = subprocess.Popen([program, *arguments], stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
        self.port = None
        for line in self.process.stderr:
            found = re.search(r"ws://127\.0\.0\.1:(\d+)/", line)
            if found:
                self.port = int(found.group(1))
                break
        check(self.port, "Chromium starts")

    def tab(self, link):
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=LONG)
        connection.request("PUT", "/json/new?about:blank")
        target = json.loads(connection.getresponse().read())
        tab = Tab(target["webSocketDebuggerUrl"])
        tab.call("Page.navigate", url=link)
        return tab

    def end(self):
        self.process.send_signal(signal.SIGTERM)
        self.process.wait(LONG)


class Tab:
    """A page of the browser."""

    def __init__(self, address):
        self.socket = websocket.create_connection(address, timeout=LONG, suppress_origin=True)
        self.number, self.wrong = 0, []
        for domain in ["Page", "Runtime", "Log", "Accessibility"]:
            self.call(f"{domain}.enable")

    def call(self, method, **params):
        self.number += 1
        self.socket.send(json.dumps({"id": self.number, "method": method, "params": params}))
        while True:
            heard = json.loads(self.socket.recv())
            if heard.get("id") == self.number:
                if "error" in heard:
                    raise SystemExit(f"FAILED: {method}: {heard['error']}")
                return heard["result"]
            self.note(heard)

    def note(self, heard):
        if heard.get("method") == "Runtime.exceptionThrown":
            self.wrong.append(heard["params"]["exceptionDetails"]["text"])
        if heard.get("method") == "Log.entryAdded" and heard["params"]["entry"]["level"] == "error":
            self.wrong.append(heard["params"]["entry"]["text"])

    def run(self, script):
        found = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in found:
            raise SystemExit(f"FAILED: {script}: {found['exceptionDetails']}")
        return found["result"].get("value")

    def until(self, script, what):
        end = time.time() + LONG
        while time.time() < end:
            # Of a page that isn't there yet nothing holds.
            if self.run(f"Boolean(document.body && ({script}))"):
                print(f"ok: {what}", flush=True)
                return
            time.sleep(0.03)
        raise SystemExit(f"FAILED: {what}; the page says: {self.run('document.body.innerText')}")

    def settle(self):
        """Waits until no frame has come for a while."""
        last, since = None, time.time()
        end = time.time() + LONG
        while time.time() < end:
            now = self.run("document.body.dataset.frame")
            if now != last:
                last, since = now, time.time()
            elif time.time() - since > 0.6:
                return
            time.sleep(0.05)

    def mouse(self, kind, at, button="left", **more):
        buttons = 0 if kind == "mouseReleased" else {"left": 1, "right": 2, "middle": 4, "none": 0}[button]
        self.call("Input.dispatchMouseEvent", type=kind, x=at[0], y=at[1], button=button, buttons=buttons, clickCount=1, **more)

    def key(self, key, code=None, modifiers=0, text=None):
        names = {"Escape": 27, "Enter": 13, "Tab": 9, "z": 90, "Backspace": 8}
        for kind in ["keyDown", "keyUp"]:
            sent = {"type": kind, "key": key, "code": code or key, "modifiers": modifiers,
                    "windowsVirtualKeyCode": names.get(key, ord(key[0].upper()))}
            if text and kind == "keyDown":
                sent["text"] = text
            self.call("Input.dispatchKeyEvent", **sent)

    def middle(self, pane, share=(0.5, 0.5)):
        box = self.run(f"(() => {{ const b = document.getElementById('{pane}').getBoundingClientRect(); return [b.left, b.top, b.width, b.height]; }})()")
        return [box[0] + share[0] * box[2], box[1] + share[1] * box[3]]

    def pixels(self, pane):
        """The bytes of a canvas, as colours."""
        script = f"""(() => {{ const c = document.getElementById('{pane}');
            const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;
            let s = ''; for (let i = 0; i < d.length; i += 0x8000) s += String.fromCharCode(...d.subarray(i, i + 0x8000)); return btoa(s); }})()"""
        return base64.b64decode(self.run(script))

    def picture(self, file):
        shot = self.call("Page.captureScreenshot", format="png")
        pathlib.Path(file).write_bytes(base64.b64decode(shot["data"]))


def changed(before, after):
    """Share of the pixels that differ."""
    count = len(before) // 4
    return sum(before[4 * i:4 * i + 3] != after[4 * i:4 * i + 3] for i in range(count)) / count


def serve(program, scene):
    process = subprocess.Popen([program, "serve", scene, "--json", "--cache", "off", "-q"], stdout=subprocess.PIPE, text=True)
    return process, json.loads(process.stdout.readline())


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("--chromium", default=shutil.which("chromium") or shutil.which("google-chrome"))
    parser.add_argument("--pictures")
    parser.add_argument("--scene")
    asked = parser.parse_args()
    program = os.path.abspath(asked.program)
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        scene = pathlib.Path(asked.scene) if asked.scene else folder / "scene.toml"
        if not asked.scene:
            scene.write_text(SCENE)
        server, links = serve(program, str(scene))
        browser = Chromium(asked.chromium, folder / "profile")
        try:
            work(browser, links, program, folder, asked.pictures)
        finally:
            browser.end()
            server.send_signal(signal.SIGINT)
            code = server.wait(LONG)
        check(code == 130, "interrupted, the server ends with 130")


def work(browser, links, program, folder, pictures):
    def shown(tab, name):
        if pictures:
            pathlib.Path(pictures).mkdir(parents=True, exist_ok=True)
            tab.picture(pathlib.Path(pictures) / f"{name}.png")

    tab = browser.tab(links["drive"])
    tab.until("document.body.dataset.frame && document.getElementById('driving').textContent === 'you drive'", "the page shows a frame and drives")
    tab.settle()
    shown(tab, "first")
    before = {pane: tab.pixels(pane) for pane in ["volume", "axial", "coronal", "sagittal"]}
    check(all(len(set(data)) > 20 for data in before.values()), "four pictures have something in them")

    watcher = browser.tab(links["watch"])
    watcher.until("document.getElementById('driving').textContent === 'you watch' && document.body.dataset.frame", "a second tab watches")

    tab.call("Page.bringToFront")

    # A drag by mouse.
    tab.run("document.querySelector('input[value=handle]').click()")
    start = tab.middle("volume")
    tab.mouse("mouseMoved", start, "none")
    tab.until("document.getElementById('status').textContent.includes(' mm')", "the place under the pointer is told")
    tab.mouse("mousePressed", start)
    tab.until("document.querySelectorAll('#handles tr.held').length === 1", "a handle is held")
    for step in range(1, 9):
        tab.mouse("mouseMoved", [start[0] + step, start[1] - step])
        time.sleep(0.03)
    tab.settle()
    shown(tab, "held")
    tab.mouse("mouseReleased", [start[0] + 8, start[1] - 8])
    tab.until("!document.getElementById('undo').disabled && !document.querySelector('#handles tr.held')", "a drag is a step")
    tab.mouse("mouseMoved", [5, 5], "none")
    tab.settle()
    shown(tab, "dragged")
    share = changed(before["volume"], tab.pixels("volume"))
    check(0.01 <= share <= 0.6, f"{100 * share:.1f} % of the volume's pixels changed")
    last = tab.run("document.body.dataset.frame")
    watcher.until(f"Number(document.body.dataset.frame) >= {last}", "the other tab has the frame too")
    check(watcher.run("document.querySelectorAll('#handles tr').length") == 1, "and its handle")
    watcher.call("Page.bringToFront")
    watcher.run("document.querySelector('input[value=handle]').click()")
    watcher.mouse("mousePressed", watcher.middle("volume"))
    watcher.mouse("mouseReleased", watcher.middle("volume"))
    watcher.run("document.getElementById('undo').click()")
    watcher.until("document.getElementById('problem').textContent.includes('lets watch')", "who watches can't undo")

    # Esc in mid-drag leaves what was before.
    tab.call("Page.bringToFront")
    by = "[...document.querySelectorAll('#handles input')].map((field) => field.value).join()"
    was = tab.run(by)
    here = [start[0] + 8, start[1] - 8]
    tab.mouse("mouseMoved", here, "none")
    tab.mouse("mousePressed", here)
    tab.until("document.querySelectorAll('#handles tr.held').length === 1", "it is held again")
    tab.mouse("mouseMoved", [here[0] + 6, here[1]])
    tab.until(f"({by}) !== {json.dumps(was)}", "and moved")
    tab.key("Escape")
    tab.until(f"({by}) === {json.dumps(was)} && !document.querySelector('#handles tr.held')", "Esc takes it back")
    tab.mouse("mouseReleased", here)

    # What is kept is what is shown, and what the pipeline makes of it.
    tab.call("Browser.setDownloadBehavior", behavior="allow", downloadPath=str(folder))
    for what, name in [("scene", "scene.toml"), ("volume", "deformed.nii.gz"), ("displacement", "inverse.nrrd"), ("picture", "picture.png"),
                       ("lattice", "lattice.ply"), ("log", "session.jsonl")]:
        target = folder / name
        if name == "scene.toml" and target.exists():
            target.unlink()
        tab.run(f"(() => {{ const s = document.getElementById('save'); s.value = '{what}'; s.dispatchEvent(new Event('change')); }})()")
        end = time.time() + LONG
        while time.time() < end and not (target.exists() and target.stat().st_size > 0):
            time.sleep(0.05)
        check(target.exists(), f"{name} is kept")
    run = subprocess.run([program, "pipeline", str(folder / "scene.toml"), "--cache", "off", "--out", str(folder / "out"), "-q"])
    check(run.returncode == 0, "the pipeline runs the scene")
    for name in ["deformed.nii.gz", "inverse.nrrd"]:
        mine, theirs = (hashlib.blake2b((where / name).read_bytes()).hexdigest() for where in [folder, folder / "out"])
        check(mine == theirs, f"{name} of another process is the same to the byte")

    # Undo by keys gives the first pictures back.
    tab.run("document.activeElement.blur()")
    tab.key("z", "KeyZ", modifiers=2)
    tab.until("document.querySelectorAll('#handles tr').length === 0", "Ctrl+Z takes the handle away")
    tab.run("document.querySelector('input[value=turn]').click()")
    tab.settle()
    share = changed(before["volume"], tab.pixels("volume"))
    check(share == 0, "and the volume's picture is that of the beginning")

    # A cut by a line over a slice, and closed by its row.
    tab.run("document.querySelector('input[value=incise]').click()")
    ends = [tab.middle("axial", (0.4, 0.4)), tab.middle("axial", (0.6, 0.45))]
    tab.mouse("mouseMoved", ends[0], "none")
    tab.mouse("mousePressed", ends[0])
    tab.mouse("mouseMoved", ends[1])
    time.sleep(0.1)
    shown(tab, "line")
    tab.mouse("mouseReleased", ends[1])
    tab.until("document.getElementById('parts').innerText.includes('its lips')", "a line cuts open")
    tab.settle()
    shown(tab, "cut")
    tab.run("document.querySelector('#parts button').click()")
    tab.until("document.getElementById('parts').children.length === 0", "and its row closes it")
    tab.run("document.querySelector('input[value=turn]').click()")

    # The body at rest, and both divided by a line; a length over a slice, taken away by its row.
    tab.run("document.activeElement.blur()")
    tab.key("o", "KeyO")
    tab.until("document.getElementById('compare').value === 'rest'", "O shows the body at rest")
    tab.key("w", "KeyW")
    tab.until("document.getElementById('compare').value === 'both'", "W shows it beside what it is now")
    tab.key("w", "KeyW")
    tab.until("document.getElementById('compare').value === 'now'", "and W again what it is now")
    tab.run("document.querySelector('input[value=measure]').click()")
    tab.mouse("mouseMoved", ends[0], "none")
    tab.mouse("mousePressed", ends[0])
    tab.mouse("mouseMoved", ends[1])
    tab.mouse("mouseReleased", ends[1])
    tab.until("document.getElementById('parts').innerText.includes('ruler')", "a line is measured")
    tab.run("document.querySelector('#parts button').click()")
    tab.until("document.getElementById('parts').children.length === 0", "and its row takes it away")
    tab.run("document.querySelector('input[value=turn]').click()")

    # The keyboard alone: a handle at a place, moved by its row, undone.
    def typed(field, text):
        tab.run(f"{field}.focus(); {field}.select()")
        for letter in text:
            tab.call("Input.dispatchKeyEvent", type="char", text=letter)
        tab.key("Enter", text="\r")

    def add():
        typed("document.getElementById('place')", "32, 58, 32")
        tab.until("document.querySelectorAll('#handles tr').length === 1", "a handle is typed")

    def undo(steps):
        tab.run("document.activeElement.blur()")
        for _ in range(steps):
            tab.key("z", "KeyZ", modifiers=2)
        tab.until("document.querySelectorAll('#handles tr').length === 0", "and undone")

    move = "document.querySelectorAll('#handles input')[1]"
    add()
    typed(move, "-1.5")
    tab.until("document.getElementById('undo').title.includes('move')", "and moved by its row")
    undo(2)

    # What voxels can't follow by what is nearest is offered by the smoothest, at a press.
    add()
    typed(move, "-60")
    tab.until("document.getElementById('instead').textContent === 'Follow smoothest' && !document.getElementById('problem').hidden", "another map is offered")
    shown(tab, "offered")
    tab.run("document.getElementById('instead').click()")
    tab.until("document.getElementById('map').value === 'biharmonic'", "and taken")
    tab.settle()
    undo(2)
    tab.until("document.getElementById('map').value === 'octree'", "with the map that was before")

    # Every control says what it is, each by a name of its own.
    nodes = tab.call("Accessibility.getFullAXTree")["nodes"]
    controls = [(node["role"]["value"], node.get("name", {}).get("value", "")) for node in nodes
                if not node.get("ignored") and node.get("role", {}).get("value") in
                {"button", "textbox", "spinbutton", "combobox", "radio", "checkbox", "slider", "img", "image"}]
    check(len(controls) > 15 and all(name for _, name in controls), f"{len(controls)} controls have names")
    check(len(set(controls)) == len(controls), "of their own")
    shown(tab, "last")
    wrong = tab.wrong + watcher.wrong
    check(not wrong, f"nothing goes wrong in the page {wrong or ''}")


if __name__ == "__main__":
    main()
