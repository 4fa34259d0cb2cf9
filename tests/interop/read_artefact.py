"""Reads an artefact from docs/artefacts.md alone: struct and json, and blake3 from PyPI where it is installed.

    python read_artefact.py FILE...    prints what each file holds; exits 1 where one isn't as documented
"""

import json
import struct
import sys

KINDS = ["volume", "labels", "mask", "transfer", "lattice", "octree", "motion", "displacement", "image", "tree"]
FORMATS = dict(u8="B", i8="b", u16="H", i16="h", u32="I", i32="i", u64="Q", f32="f", f64="d")
CHUNK = 4 << 20

try:
    from blake3 import blake3
except ImportError:
    blake3 = None


def digest(data):
    return blake3(data).digest()


class Fields:
    """Fields of the metadata, one after the other."""

    def __init__(self, data):
        self.data, self.at = data, 0

    def number(self, form):
        (value,) = struct.unpack_from("<" + form, self.data, self.at)
        self.at += struct.calcsize(form)
        return value

    def bytes(self, count):
        self.at += count
        assert self.at <= len(self.data), "metadata end too soon"
        return self.data[self.at - count : self.at]

    def text(self):
        return self.bytes(self.number("Q")).decode("utf-8")

    def list(self, item):
        return [item() for _ in range(self.number("Q"))]

    def hash(self):
        return self.bytes(32)

    def section(self):
        return dict(
            name=self.text(),
            element=self.text(),
            shape=self.list(lambda: self.number("Q")),
            offset=self.number("Q"),
            length=self.number("Q"),
            hash=self.hash(),
            chunks=self.list(self.hash),
        )


def align(offset):
    return -(-offset // 4096) * 4096


def content_hash(kind, version, content, sections):
    def text(t):
        raw = t.encode("utf-8")
        return struct.pack("<Q", len(raw)) + raw

    data = b"IVDC" + struct.pack("<HH", kind, version) + text(content) + struct.pack("<Q", len(sections))
    for s in sections:
        data += text(s["name"]) + text(s["element"]) + struct.pack("<Q", len(s["shape"]))
        data += struct.pack("<%dQ" % len(s["shape"]), *s["shape"]) + s["hash"]
    return digest(data).hex()


def read(path):
    """The artefact as a dict; `arrays` holds each section's elements as a flat tuple, in C order of its shape."""
    with open(path, "rb") as file:
        data = file.read()
    magic, container, kind, version, count, flags, metadata, offset, payload, root = struct.unpack_from(
        "<4sHHHHIIIQ32s", data
    )
    assert magic == b"IVDA" and container == 1 and flags == 0, "not an artefact of version 1"
    assert offset == align(64 + metadata) and offset + payload == len(data), "lengths don't agree"
    assert not any(data[64 + metadata : offset]), "padding after the metadata"

    fields = Fields(data[64 : 64 + metadata])
    out = dict(kind=KINDS[kind - 1], version=version, stage=fields.text(), revision=fields.number("I"))
    out["params"] = json.loads(fields.text())
    out["inputs"] = {name: hash.hex() for name, hash in fields.list(lambda: (fields.text(), fields.hash()))}
    out["backend"] = fields.text()
    out["metrics"] = json.loads(fields.text())
    content = fields.text()
    out["content"] = json.loads(content)
    sections = fields.list(fields.section)
    assert fields.at == metadata and len(sections) == count, "the metadata don't fill their room"

    end, out["arrays"], out["shapes"] = offset, {}, {}
    for s in sections:
        assert s["offset"] == align(end) and not any(data[end : s["offset"]]), s["name"]
        end = s["offset"] + s["length"]
        form, n = FORMATS[s["element"]], 1
        for axis in s["shape"]:
            n *= axis
        assert n * struct.calcsize("<" + form) == s["length"], s["name"]
        out["shapes"][s["name"]] = s["shape"]
        out["arrays"][s["name"]] = struct.unpack_from("<%d%s" % (n, form), data, s["offset"])
    assert end == len(data), "the last section doesn't end the file"

    if blake3 is not None:
        assert digest(data[:32] + data[64:offset]) == root, "root"
        for s in sections:
            raw = data[s["offset"] : s["offset"] + s["length"]]
            assert s["chunks"] == [digest(raw[i : i + CHUNK]) for i in range(0, len(raw), CHUNK)], s["name"]
            assert s["hash"] == digest(b"".join(s["chunks"])), s["name"]
        out["hash"] = content_hash(kind, version, content, sections)
    return out


def main(paths):
    if blake3 is None:
        print("blake3 is not installed: hashes are not checked", file=sys.stderr)
    for path in paths:
        try:
            found = read(path)
        except (AssertionError, struct.error, ValueError, IndexError) as problem:
            sys.exit("%s: %s" % (path, problem))
        shapes = ", ".join("%s %s" % pair for pair in found["shapes"].items())
        print("%s: %s %d, %s: %s" % (path, found["kind"], found["version"], found.get("hash", "")[:12], shapes))


if __name__ == "__main__":
    main(sys.argv[1:])
