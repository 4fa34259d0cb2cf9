"""start.py PROGRAM [PICTURE]: starts the window on the demo, waits until the head is seen, and looks at what the program said.

The screen is Xvfb's, which keeps its pixels in a file; PICTURE is written as PNG. Standard library only.
"""

import os
import struct
import subprocess
import sys
import tempfile
import time
import zlib

SIZE = 1280, 800
# The head is opened, drawn and shown within so many seconds, on a machine that does other things as well.
LONG = 240


def pixels(file):
    """Rows of blue, green, red, unused bytes of a screen in XWD, and its size."""
    data = open(file, "rb").read()
    head = struct.unpack(">25I", data[:100])
    start = head[0] + 12 * head[19]
    width, height, per_line = head[4], head[5], head[12]
    assert head[11] == 32 and head[7] == 0, "32 bits, the lowest byte first"
    return width, height, [data[start + per_line * y :][: 4 * width] for y in range(height)]


def png(width, height, rows):
    """The bytes of a PNG file."""
    def chunk(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    def rgb(row):
        out = bytearray(3 * width)
        out[0::3], out[1::3], out[2::3] = row[2::4], row[1::4], row[0::4]
        return bytes(out)

    raw = b"".join(b"\0" + rgb(row) for row in rows)
    head = struct.pack(">2I5B", width, height, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(raw, 6)) + chunk(b"IEND", b"")


def colours(rows):
    """How many colours are seen."""
    return len({row[i : i + 3] for row in rows[::2] for i in range(0, len(row), 8)})


def skin(rows):
    """Pixels that are clearly more red than blue, as the demo's skin and bone are, and no sign of the window is."""
    return sum(row[i + 2] > row[i] + 25 and row[i + 2] > 80 for row in rows[::2] for i in range(0, len(row), 8))


def main():
    program = os.path.realpath(sys.argv[1])
    picture = sys.argv[2] if len(sys.argv) > 2 else None
    with tempfile.TemporaryDirectory() as folder:
        reads, writes = os.pipe()
        screen = subprocess.Popen(
            ["Xvfb", "-displayfd", str(writes), "-screen", "0", "%dx%dx24" % SIZE, "-fbdir", folder, "-nolisten", "tcp"],
            pass_fds=[writes], stderr=subprocess.DEVNULL,
        )
        os.close(writes)
        with os.fdopen(reads) as number:
            display = number.readline().strip()
        environment = dict(os.environ, DISPLAY=":" + display, HOME=folder, XDG_RUNTIME_DIR=folder, XDG_DATA_HOME=folder, XDG_CONFIG_HOME=folder)
        environment.pop("WAYLAND_DISPLAY", None)
        said = open(os.path.join(folder, "said"), "w+")
        window = subprocess.Popen([program, "demo"], env=environment, cwd=folder, stdout=said, stderr=said)
        try:
            start, seen = time.monotonic(), 0
            while time.monotonic() - start < LONG:
                time.sleep(1)
                if window.poll() is not None:
                    said.seek(0)
                    sys.exit("the window ended by itself, exit %s:\n%s" % (window.returncode, said.read()))
                width, height, rows = pixels(os.path.join(folder, "Xvfb_screen0"))
                seen = skin(rows)
                if seen > width * height // 4 // 40:
                    break
            else:
                sys.exit("the head isn't seen after %d s (%d pixels of skin)" % (LONG, seen))
            took = time.monotonic() - start
            time.sleep(2)
            width, height, rows = pixels(os.path.join(folder, "Xvfb_screen0"))
            if picture:
                open(picture, "wb").write(png(width, height, rows))
            many = colours(rows)
            assert many > 500, "%d colours are no window" % many
            said.seek(0)
            text = said.read()
            for word in ("Validation", "validation", "panicked", "ERROR"):
                assert word not in text, text
            print("the window shows the head after %.0f s: %d colours, %d pixels of skin in four" % (took, many, seen))
        finally:
            window.terminate()
            try:
                window.wait(20)
            finally:
                window.kill()
                screen.terminate()


main()
