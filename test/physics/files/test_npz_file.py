# SPDX-License-Identifier: Apache-2.0
"""Archives: what NumPy writes is read to the bit, whatever else they hold is refused in time."""

import io
import time
import tracemalloc
import zipfile

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from rover_physics.errors import RoverFileError
from rover_physics.files.npz_file import NpzReader, open_npz
from support.hostile_files import archive_of, npy

MOST = 1_000_000
DTYPES = ["f2", "f4", "f8", ">f4", ">f8", "i1", "i2", "i4", ">i8", "u1", "u8", "?", "<U3", ">U5"]


def read(archive: bytes, dtype=None, most=MOST):
    return NpzReader(io.BytesIO(archive)).read("a", dtype, most=most)


def refusal(archive: bytes, most=MOST) -> str:
    """Return the error of an archive, which must come at once and in little memory."""
    tracemalloc.start()
    began = time.perf_counter()
    with pytest.raises(RoverFileError) as raised:
        read(archive, most=most)
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
@settings(deadline=None, max_examples=60)
def test_arrays_are_read_as_numpy_reads_them(array, order, packed):
    buffer = io.BytesIO()
    (np.savez_compressed if packed else np.savez)(buffer, a=np.asarray(array, order=order))
    with np.load(io.BytesIO(buffer.getvalue())) as expected:
        found = read(buffer.getvalue())
        assert found.dtype == expected["a"].dtype.newbyteorder("=")
        np.testing.assert_array_equal(found, expected["a"])


@pytest.mark.parametrize("order", "CF")
def test_a_large_array_is_read_in_the_wanted_type_in_one_and_a_half_of_its_memory(tmp_path, order):
    values = np.asarray(np.random.default_rng(1).normal(size=(700, 900)), np.float32, order=order)
    np.savez(tmp_path / "a.npz", a=values)
    needed = 8 * values.size
    with open_npz(tmp_path / "a.npz") as archive:
        tracemalloc.start()
        found = archive.read("a", np.float64, most=needed)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert found.flags.c_contiguous
    np.testing.assert_array_equal(found, values.astype(np.float64))
    assert peak < 1.5 * needed + 2_000_000


HEAD = "{'descr': '%s', 'fortran_order': False, 'shape': %s, }"


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (npy(HEAD % ("<f8", "(900000, 900000)")), "claims shape (900000, 900000) of type <f8"),
        (npy(HEAD % ("<f8", "(" + "9" * 400 + ",)")), "is damaged"),
        (npy((HEAD % ("<f8", "(3, "))[:-4]), "is damaged"),
        (npy("{'descr': '<f8', 'fortran_order': 1or 2, 'shape': (3,)}"), "is damaged"),
        (npy("(" * 5000), "is damaged"),
        (npy("{'descr': exit(), 'fortran_order': False, 'shape': (3,)}"), "is damaged"),
        (npy(HEAD % ("<f8", "(3,), 'shape': (2,)"), bytes(24)), "is damaged"),
        (npy(HEAD % ("|O", "(3,)")), "holds Python objects"),
        (npy(HEAD % ("<U9999999", "(3,)")), "is damaged: its header claims"),
        (npy(HEAD % ("<U0", "(999999999999,)")), "elements of type <U0"),
        (npy(HEAD % ("<c16", "(3,)")), "elements of type <c16"),
        (npy(HEAD % ("<f8", "(3,)"), bytes(16)), "is damaged: its header claims shape (3,)"),
        (npy(HEAD % ("<f8", "(3,)"), bytes(99)), "is damaged: its header claims shape (3,)"),
        (npy(HEAD % ("<U1", "(1,)"), b"\xff" * 4), "characters that do not exist"),
        (npy("", version=2, length=2**32 - 1) + bytes(10**7), "has a header of version (2, 0)"),
        (npy("", version=9), "has a header of version (9, 0)"),
        (b"\x80\x04K\x01.", "is damaged"),
        (b"", "is damaged"),
    ],
)
def test_an_impossible_array_is_refused_with_the_reason_and_without_a_warning(
    content, reason, recwarn
):
    assert reason in refusal(archive_of(content))
    assert not recwarn.list


@pytest.mark.parametrize("method", [zipfile.ZIP_LZMA, zipfile.ZIP_BZIP2])
def test_an_unusual_method_of_compression_is_refused(method):
    content = npy(HEAD % ("<f8", "(1,)"), bytes(8))
    assert f"packed by method {method}" in refusal(archive_of(content, method=method))


def test_an_encrypted_array_is_refused():
    data = bytearray(archive_of(npy(HEAD % ("<f8", "(1,)"), bytes(8))))
    data[6] |= 1
    data[data.find(b"PK\x01\x02") + 8] |= 1
    assert "is encrypted" in refusal(bytes(data))


def test_every_truncated_archive_is_refused():
    content = archive_of(npy(HEAD % ("<f8", "(40,)"), np.arange(40.0).tobytes()))
    for length in range(0, len(content), 60):
        assert refusal(content[:length])


def test_an_archive_with_a_damaged_array_is_refused():
    content = bytearray(archive_of(npy(HEAD % ("<f8", "(40,)"), bytes(320)), method=0))
    content[200] ^= 1
    assert "is damaged (Bad CRC-32" in refusal(bytes(content))


def test_an_array_that_unpacks_to_more_than_the_limit_is_not_unpacked():
    content = npy(HEAD % ("<f8", "(4000, 4000)"), bytes(8 * 4000**2))
    packed = archive_of(content)
    assert len(packed) < 200_000
    assert "takes 128000000 bytes of memory; it may take at most 1000000" in refusal(packed)
