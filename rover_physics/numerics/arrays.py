# SPDX-License-Identifier: Apache-2.0
"""Array types for annotations, and read-only arrays, from which results cannot become stale."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
"""Array of double precision numbers."""
SingleFloats = NDArray[np.float32]
"""Array of single precision numbers, for large results that need few digits."""


def is_frozen(array: np.ndarray) -> bool:
    """Return whether an array and all arrays that it is a view of are read-only."""
    owner: Any = array
    while isinstance(owner, np.ndarray):
        if owner.flags.writeable:
            return False
        owner = owner.base
    return owner is None or isinstance(owner, bytes)


def freeze_array(array: np.ndarray) -> np.ndarray:
    """Return a read-only array: the same one if `is_frozen`, else a copy.

    `seal_array` avoids the copy for an array that is used nowhere else.
    """
    if is_frozen(array):
        return array
    frozen = array.copy()
    frozen.flags.writeable = False
    return frozen


def seal_array(array: np.ndarray) -> np.ndarray:
    """Make an array and all arrays that it is a view of read-only in place, and return it.

    Use it for a new array that is used nowhere else.
    """
    owner: Any = array
    while isinstance(owner, np.ndarray):
        owner.flags.writeable = False
        owner = owner.base
    return array


def view_read_only(array: np.ndarray) -> np.ndarray:
    """Return a read-only view of an array.

    Numba compiles a kernel once for arrays that can be written and once for others. It compiles
    only once if all arrays that it reads are such views.
    """
    view = array.view()
    view.flags.writeable = False
    return view


def freeze_fields(record: Any) -> None:
    """Make all arrays of a dataclass read-only in place; no one else may write into them."""
    for value in vars(record).values():
        if isinstance(value, np.ndarray):
            value.flags.writeable = False
