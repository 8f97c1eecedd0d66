# SPDX-License-Identifier: Apache-2.0
"""Files of users: no pipe is waited for; archives are read to the bit or refused in time."""

import io
import os
import socket
import struct
import time
import tracemalloc
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from rover_physics import RoverError, load_rover, load_terrain
from rover_physics.errors import RoverFileError
from rover_physics.files.npz_file import NpzReader, open_npz
from rover_physics.files.user_file import read_regular_file, write_file
from rover_planner.command.prediction_files import read_poses, read_prediction
from rover_planner.errors import PlanningError
from rover_planner.studies.study_file import load_study

MOST = 1_000_000
DTYPES = ["f2", "f4", "f8", ">f4", ">f8", "i1", "i2", "i4", ">i8", "u1", "u8", "?", "<U3", ">U5"]


def archive_of(content: bytes, method=zipfile.ZIP_DEFLATED) -> bytes:
    """Return an archive of one member."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", method) as archive:
        archive.writestr("a.npy", content)
    return buffer.getvalue()


def npy(header: str, data: bytes = b"") -> bytes:
    """Return an .npy file with a header of one's own."""
    text = header.encode("latin1")
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text + data


def read(archive: bytes):
    return NpzReader(io.BytesIO(archive)).read("a", most=MOST)


def refusal(archive: bytes) -> str:
    """Return the error of an archive, which must come at once and in little memory."""
    tracemalloc.start()
    began = time.perf_counter()
    with pytest.raises(RoverFileError) as raised:
        read(archive)
    assert time.perf_counter() - began < 20.0
    assert tracemalloc.get_traced_memory()[1] < 4_000_000
    tracemalloc.stop()
    return str(raised.value)


@given(
    st.sampled_from(DTYPES).flatmap(
        lambda dtype: arrays.arrays(dtype, arrays.array_shapes(min_dims=0, min_side=0))
    ),
    st.sampled_from("CF"),
    st.booleans(),
)
def test_arrays_are_read_as_numpy_writes_them(array, order, packed):
    buffer = io.BytesIO()
    (np.savez_compressed if packed else np.savez)(buffer, a=np.asarray(array, order=order))
    found = read(buffer.getvalue())
    assert found.dtype == array.dtype.newbyteorder("=")
    np.testing.assert_array_equal(found, array)


@pytest.mark.parametrize("order", "CF")
def test_a_large_array_is_read_in_the_wanted_type_in_one_and_a_half_of_its_memory(tmp_path, order):
    values = np.asarray(np.random.default_rng(1).normal(size=(700, 900)), np.float32, order=order)
    np.savez(tmp_path / "a.npz", a=values)
    needed = 8 * values.size
    with open_npz(tmp_path / "a.npz") as archive:
        tracemalloc.start()
        found = archive.read("a", most=values.size, dtype=np.float64)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert found.flags.c_contiguous
    np.testing.assert_array_equal(found, values.astype(np.float64))
    assert peak < 1.5 * needed + 2_000_000


HEAD = "{'descr': '%s', 'fortran_order': False, 'shape': %s, }"
ONE = npy(HEAD % ("<f8", "(1,)"), bytes(8))


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (npy(HEAD % ("<f8", "(900000, 900000)")), "its header claims <f8(900000, 900000)"),
        (npy(HEAD % ("<f8", "(" + "9" * 400 + ",)")), "is damaged"),
        (npy("{'descr': '<f8', 'fortran_order': 1or 2, 'shape': (3,)}"), "is damaged"),
        (npy("(" * 5000), "is damaged"),
        (npy(HEAD % ("<f8", "(3,), 'shape': (2,)"), bytes(24)), "is damaged"),
        (npy(HEAD % ("|O", "(3,)")), "is damaged (Object arrays cannot be loaded"),
        (npy(HEAD % ("<U9999999", "(3,)")), "its header claims"),
        (npy(HEAD % ("<U0", "(999999999999,)")), "of type <U0; it must hold plain"),
        (npy(HEAD % ("<c16", "(1,)"), bytes(16)), "of type complex128; it must"),
        (npy(HEAD % ("<f8", "(3,)"), bytes(16)), "is damaged: its header claims <f8(3,)"),
        (npy(HEAD % ("<U1", "(1,)"), b"\xff" * 4), "characters that do not exist"),
        (b"\x93NUMPY\x02\x00\xff\xff\xff\xff" + bytes(10**6), "is damaged"),
        (b"\x80\x04K\x01.", "is damaged"),
        (b"", "is damaged"),
    ],
)
def test_an_impossible_array_is_refused_with_the_reason_and_without_a_warning(
    content, reason, recwarn
):
    assert reason in refusal(archive_of(content))
    assert not recwarn.list


def test_unusual_compression_encryption_and_damage_are_refused():
    packed = {method: archive_of(ONE, method=method) for method in (zipfile.ZIP_LZMA, 0)}
    assert "packed by method 14" in refusal(packed[zipfile.ZIP_LZMA])
    encrypted, damaged = bytearray(packed[0]), bytearray(packed[0])
    encrypted[6] |= 1
    encrypted[encrypted.find(b"PK\x01\x02") + 8] |= 1
    assert "is encrypted" in refusal(bytes(encrypted))
    damaged[damaged.find(b"PK\x01\x02") - 1] ^= 1
    assert "is damaged (Bad CRC-32" in refusal(bytes(damaged))


def test_every_truncated_archive_is_refused():
    content = archive_of(npy(HEAD % ("<f8", "(40,)"), np.arange(40.0).tobytes()))
    for length in range(0, len(content), 60):
        assert refusal(content[:length])


def test_an_array_that_unpacks_to_more_than_the_limit_is_not_unpacked():
    content = npy(HEAD % ("<f8", "(4000, 4000)"), bytes(8 * 4000**2))
    packed = archive_of(content)
    assert len(packed) < 200_000
    assert "takes 128000075 bytes of memory; the limit is 1000000 values" in refusal(packed)


KINDS = {
    "pipe": "a named pipe",
    "folder": "a directory",
    "socket": "a socket",
    "to_zero": "a device",
    "loop": "Too many levels of symbolic links",
    "dangling": "No such file",
}


def make_oddities(folder: Path) -> list[str]:
    """Make things that are no regular files in a folder; return their names, and worse names."""
    os.mkfifo(folder / "pipe")
    (folder / "folder").mkdir()
    (folder / "loop").symlink_to(folder / "loop")
    (folder / "dangling").symlink_to(folder / "nowhere")
    (folder / "to_zero").symlink_to("/dev/zero")
    with socket.socket(socket.AF_UNIX) as here:
        here.bind(str(folder / "socket"))
    return [
        *(str(folder / name) for name in KINDS), "/dev/zero", "/dev/full", "/dev/stdin", "/proc",
        "/proc/self/mem", "/proc/kmsg", "x" * 300, "x/" * 3000, "", ".", "..", "\n\x1b[2J", "é",
        "\udcff", "a\0b", str(folder / "folder" / ".." / "nowhere"),
    ]  # fmt: skip


READERS = (load_rover, load_study, load_terrain, read_poses, read_prediction)


@pytest.mark.parametrize("name", KINDS)
def test_what_is_no_regular_file_is_refused_with_its_kind(tmp_path, name):
    make_oddities(tmp_path)
    with pytest.raises(RoverFileError, match=KINDS[name]):
        read_regular_file(tmp_path / name, 1000)


@pytest.mark.parametrize("read", READERS, ids=lambda read: read.__name__)
def test_no_reader_waits_for_a_pipe_or_reads_a_device(tmp_path, read, monkeypatch):
    monkeypatch.chdir(tmp_path)  # a relative name means nothing there
    for name in make_oddities(tmp_path):
        began = time.perf_counter()
        with pytest.raises((RoverError, PlanningError)) as raised:
            read(Path(name))
        assert time.perf_counter() - began < 20.0, name
        assert len(str(raised.value)) <= 400
        assert str(raised.value).isprintable()


def test_a_file_above_the_limit_is_refused_even_if_the_system_does_not_know_its_size(tmp_path):
    path = tmp_path / "file"
    path.write_bytes(b"x" * 1000)
    assert read_regular_file(path, 1000) == b"x" * 1000
    assert os.stat("/proc/self/maps").st_size == 0
    for name, most in ((path, 999), ("/proc/self/maps", 100)):
        with pytest.raises(RoverFileError, match=f"larger than {most} bytes"):
            read_regular_file(name, most)


def test_writing_to_a_pipe_without_reader_a_full_disk_or_a_folder_is_refused(tmp_path):
    make_oddities(tmp_path)
    for name, reason in [
        (tmp_path / "pipe", "No such device"),
        (tmp_path / "folder", "Is a directory"),
        (tmp_path / "no" / "file", "No such file"),
        ("/dev/full", "No space left"),
        ("x" * 300, "File name too long"),
    ]:
        with pytest.raises(RoverFileError, match=f"cannot be written: {reason}"):
            write_file(name, b"content")
