"""Makes hostile files: damaged archives, impossible headers, YAML with odd tags, odd kinds."""

import io
import os
import socket
import struct
import warnings
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from rover_physics.files.config_files import find_config

HEADERS = (
    "{'descr': '<f8', 'fortran_order': False, 'shape': (12000, 12000), }",
    "{'descr': '<f8', 'fortran_order': False, 'shape': (1000000, 1000000), }",
    "{'descr': '<f8', 'fortran_order': False, 'shape': (" + "9" * 400 + ",), }",
    "{'descr': '<f8', 'fortran_order': False, 'shape': (-3, 4), }",
    "{'descr': '<f8', 'fortran_order': False, 'shape': (3, ",
    "{'descr': '<f8', 'fortran_order': False",
    "{'descr': '<f8', 'fortran_order': 1or 2, 'shape': (3, 4), }",
    "{'descr': '|O', 'fortran_order': False, 'shape': (3, 4), }",
    "{'descr': '<U100000000', 'fortran_order': False, 'shape': (3,), }",
    "{'descr': '<U0', 'fortran_order': False, 'shape': (1000000000000,), }",
    "{'descr': [('a', '<f8')], 'fortran_order': False, 'shape': (3,), }",
    "{'descr': '<f3', 'fortran_order': False, 'shape': (3, 4), }",
    "{'descr': '<f8', 'fortran_order': False, 'shape': (3L, 4L), }",
    "{'descr': 'a5', 'fortran_order': False, 'shape': (3, 4), 'more': 1}",
    "{'descr': __import__('os').abort(), 'fortran_order': False, 'shape': (3,)}",
    "(" * 5000,
    "\0" * 60,
    "",
)
"""Headers of arrays that nothing good can come of."""
NAMES = ("elevation", "elevation.npy/", "../elevation.npy", "/elevation.npy", "elevation.npy\0x",
         "é.npy", "\x1b[2J.npy", "n" * 300 + ".npy", ".npy")  # fmt: skip
"""Names of members."""
NUMBERS = (0.0, -1.0, 1e-300, 1e-9, 1e9, 1e154, 1e308, np.inf, -np.inf, np.nan)
SCALARS = (
    "!!map foo", "!!bool foo", "!!timestamp foo", "!!timestamp 2001-99-99", "!!int ''",
    "!!float x", "!!binary é", "!!python/name:os.system", "!!python/object/apply:os.abort []",
    "!!set {a}", "&self [*self]", "*nowhere", "1" * 4000, "1" * 6000, "0x" + "f" * 6000,
    "-1e" + "9" * 4000, "1e999", "-.inf", ".nan", "'" + "x" * 9000 + "'", '"\\e[31m\\n\\0"',
    "[" * 600, "{" * 600, "- " * 900, "{? [1]: 2}", "~", "2001-01-01", "1:59:59", "0o17", "yes",
    "1e308", "-5", "0", "1.0e-300", "1.0e+300", "'\ud800'", "\0", "\ufeff", "#", "|\n  x",
)  # fmt: skip
"""Values of a YAML file."""
PRESETS = ("rovers/lsr1.yaml", "soils.yaml")
STUDY = """rover: lsr1
objective: worst_utilisation
parameters: [{name: friction, from: 0.5, to: 0.9, count: 3}]
drives: [{slope: 0.1, length: 1.0}]
"""


def make_oddities(folder: Path) -> list[str]:
    """Make things that are no regular files in a folder; return their names, and worse names."""
    os.mkfifo(folder / "pipe")
    (folder / "folder").mkdir()
    (folder / "loop").symlink_to(folder / "loop")
    (folder / "dangling").symlink_to(folder / "nowhere")
    (folder / "to_zero").symlink_to("/dev/zero")
    with socket.socket(socket.AF_UNIX) as here:
        here.bind(str(folder / "socket"))
    made = ["pipe", "folder", "loop", "dangling", "to_zero", "socket"]
    return [
        *(str(folder / name) for name in made), "/dev/zero", "/dev/full", "/dev/stdin", "/proc",
        "/proc/self/mem", "/proc/kmsg", "x" * 300, "x/" * 3000, "", ".", "..", "\n\x1b[2J", "é",
        "\udcff", "a\0b", str(folder / "folder" / ".." / "nowhere"),
    ]  # fmt: skip


def archive_of(content: bytes, name="a.npy", method=zipfile.ZIP_DEFLATED) -> bytes:
    """Return an archive of one member."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", method) as archive:
        archive.writestr(name, content)
    return buffer.getvalue()


def npy(header: str, data: bytes = b"", version=1, length=None) -> bytes:
    """Return an .npy file with a header of one's own."""
    text = header.encode("latin1")
    size = struct.pack("<H" if version == 1 else "<I", len(text) if length is None else length)
    return b"\x93NUMPY" + bytes([version, 0]) + size + text + data


class FileMaker:
    """Makes the bytes of hostile files, the same ones for the same seed."""

    def __init__(self, seed: int):
        self.rng = np.random.default_rng(seed)

    def pick(self, options: Any) -> Any:
        """Return one of the options."""
        return options[int(self.rng.integers(len(options)))]

    def make_archive(self, arrays: dict[str, Any]) -> bytes:
        """Return an archive of arrays with one to three faults."""
        arrays = dict(arrays)
        for _ in range(int(self.rng.integers(0, 3))):
            name = self.pick(list(arrays))
            odd = self.rng.random() < 0.5
            arrays[name] = self.make_array() if odd else self._spoil(np.array(arrays[name]))
        content = self._zip(arrays)
        for _ in range(int(self.rng.integers(0, 3))):
            content = self._damage(content)
        return content

    def make_array(self) -> Any:
        """Return an array of an unusual type, shape or value."""
        shape = self.pick([(), (0,), (1,), (3,), (3, 3), (4, 6), (0, 3), (2, 3, 4), (40, 3)])
        dtype = self.pick(["f2", "f4", ">f8", "f8", "i1", "u8", "c16", "g", "?", "U5", "S3",
                           "M8[s]", "O", "f8,i4"])  # fmt: skip
        if dtype in ("f8", "f4", "f2"):
            with np.errstate(over="ignore"):
                return np.full(shape, self.pick(NUMBERS)).astype(dtype)
        return np.zeros(shape, dtype, order=self.pick(["C", "F"]))

    def _spoil(self, array: Any) -> Any:
        """Set one or all elements of an array to an unusual number."""
        if array.dtype == np.float64 and array.size:
            every = self.rng.random() < 0.3 or not array.shape
            at = ... if every else tuple(int(self.rng.integers(n)) for n in array.shape)
            array[at] = self.pick(NUMBERS)
        return array

    def make_yaml(self, name: str | None = None) -> bytes:
        """Return a YAML file with one to three faults, made of a preset, or of a study if ""."""
        name = self.pick([*PRESETS, ""]) if name is None else name
        text = find_config(name).read_text(encoding="utf-8") if name else STUDY
        for _ in range(int(self.rng.integers(1, 4))):
            lines = text.split("\n")
            at = int(self.rng.integers(len(lines)))
            key, colon, value = lines[at].partition(":")
            lines[at] = self.pick([
                f"{key}{colon} {self.pick(SCALARS)}", f"{key}{colon} &a {value}",
                f"<<: *a {value}", f"{self.pick(SCALARS)}: 1", f"{lines[at]}\n{lines[at]}", "",
                key, f"\t{lines[at]}", f"{key}: {float(self.pick(NUMBERS))!r}", f"{key}: [{value}",
            ])  # fmt: skip
            text = "\n".join(lines)
        content = text.encode("utf-8", "surrogatepass")
        return content if self.rng.random() < 0.8 else self._damage(content)

    def _zip(self, arrays: dict[str, Any]) -> bytes:
        buffer = io.BytesIO()
        method = self.pick([zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED] * 3 + [zipfile.ZIP_LZMA])
        with warnings.catch_warnings(), zipfile.ZipFile(buffer, "w", method) as archive:
            warnings.simplefilter("ignore")  # of names that are there twice
            for name, array in arrays.items():
                member = io.BytesIO()
                np.save(member, array, allow_pickle=True)
                archive.writestr(f"{name}.npy", self._change_header(member.getvalue()))
            if self.rng.random() < 0.2:
                archive.writestr(self.pick(NAMES), b"x" * 100)
        return buffer.getvalue()

    def _change_header(self, content: bytes) -> bytes:
        """Replace the header of an array once in ten times."""
        if self.rng.random() > 0.1:
            return content
        header = self.pick(HEADERS).encode("latin1")
        version, kind = self.pick([(1, "<H"), (2, "<I"), (3, "<I"), (9, "<I")])
        length = self.pick([len(header), len(header) + 7, 0, 65_000, 2**32 - 1])
        size = struct.pack(kind, min(length, 256 ** struct.calcsize(kind) - 1))
        return b"\x93NUMPY" + bytes([version, 0]) + size + header + content[128:]

    def _damage(self, content: bytes) -> bytes:
        """Cut, flip, repeat or insert some bytes."""
        data = bytearray(content)
        if not data:
            return b"\0"
        begin = int(self.rng.integers(len(data)))
        end = begin + int(self.rng.integers(1, 40))
        kind = self.pick(["cut", "flip", "zero", "insert", "encrypt", "method", "repeat", "empty"])
        if kind == "cut":
            del data[begin:]
        elif kind == "flip":
            for at in self.rng.integers(len(data), size=8):
                data[at] ^= 1 << int(self.rng.integers(8))
        elif kind == "zero":
            data[begin:end] = bytes(len(data[begin:end]))
        elif kind == "insert":
            data[begin:begin] = self.rng.bytes(end - begin)
        elif kind == "repeat":
            data += data[begin:]
        elif kind == "empty":
            data.clear()
        else:
            _mark_members(data, kind, int(self.pick([1, 8, 9, 12, 14, 93, 95, 99])))
        return bytes(data)


def _mark_members(data: bytearray, kind: str, method: int) -> None:
    """Say in all headers of a zip archive that the members are encrypted or packed otherwise."""
    for mark, flags in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        at = data.find(mark)
        while 0 <= at < len(data) - 12:
            data[at + flags + (2 if kind == "method" else 0)] = method if kind == "method" else 1
            at = data.find(mark, at + 4)
