# SPDX-License-Identifier: Apache-2.0
"""Records: structures of fixed shape that kernels read and write through one pointer.

Numba passes a tuple of arrays as ten numbers per array. It passes a record as one address, with
all shapes known at compile time. Python code reads a record the same way: ``placement.R[0, 1]``.
"""

from typing import Any

import numpy as np


def record_type(*fields: tuple) -> np.dtype:
    """Return the NumPy type of a record.

    Args:
        fields: (name, type) or (name, type, shape), as in NumPy.
    """
    return np.dtype((np.record, np.dtype(list(fields), align=True)))


def new_record(kind: np.dtype, **values: Any) -> Any:
    """Return a record with `values` by field name; the other fields are 0."""
    record = np.zeros(1, kind)[0]
    for name, value in values.items():
        record[name] = value
    return record


def array_of(record: Any) -> np.ndarray:
    """Return an array (1,) that holds a copy of a record.

    Passing a record from Python to a kernel takes about 15 us, because Numba describes its type at
    each call. An array takes less than 1 us. `array[0]` is the record itself, not a copy.
    """
    array = np.zeros(1, record.dtype)
    array[0] = record
    return array
