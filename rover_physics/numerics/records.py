"""Records: structures of fixed shape that kernels read and write through one pointer.

A tuple of arrays is handed from kernel to kernel as ten numbers an array; a record as one address,
with all shapes known when the kernels are compiled. From Python a record reads the same way:
``placement.R[0, 1]``.
"""

from typing import Any

import numpy as np


def record_type(*fields: tuple) -> np.dtype:
    """Return the type of a record.

    Args:
        fields: (name, type) or (name, type, shape), as numpy has them.
    """
    return np.dtype((np.record, np.dtype(list(fields), align=True)))


def new_record(kind: np.dtype, **values: Any) -> Any:
    """Return a record of zeros but for `values`, by field."""
    record = np.zeros(1, kind)[0]
    for name, value in values.items():
        record[name] = value
    return record


def array_of(record: Any) -> np.ndarray:
    """Return an array (1,) that holds a copy of a record.

    Handing a record from Python to a kernel takes some 15 us, since its whole type is described
    anew each time; an array of it less than one. `array[0]` is the record itself, not a copy.
    """
    array = np.zeros(1, record.dtype)
    array[0] = record
    return array


def shared_array_of(record: Any) -> np.ndarray:
    """Return an array (1,) that holds a record of `new_record` itself, or a copy of another."""
    base = record.base
    return base if isinstance(base, np.ndarray) and base.shape == (1,) else array_of(record)
