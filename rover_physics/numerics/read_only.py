"""Arrays that cannot be changed behind the back of those who have worked something out of them."""

from dataclasses import fields
from typing import Any

import numpy as np


def is_frozen(array: np.ndarray) -> bool:
    """Tell whether neither an array nor what it is a view of can be written into."""
    owner: Any = array
    while isinstance(owner, np.ndarray):
        if owner.flags.writeable:
            return False
        owner = owner.base
    return owner is None or isinstance(owner, bytes)


def freeze_array(array: np.ndarray) -> np.ndarray:
    """Return an array that nobody can write into: the same one if so already, else a copy.

    Whoever has made an array for this alone saves the copy by `seal_array`.
    """
    if is_frozen(array):
        return array
    frozen = array.copy()
    frozen.flags.writeable = False
    return frozen


def seal_array(array: np.ndarray) -> np.ndarray:
    """Make an array read-only in place, with all that it is a view of, and return it.

    For whoever has made the array and keeps no other use of it.
    """
    owner: Any = array
    while isinstance(owner, np.ndarray):
        owner.flags.writeable = False
        owner = owner.base
    return array


def freeze_fields(record: Any) -> None:
    """Make all arrays of a dataclass read-only in place; they must belong to it alone."""
    for field in fields(record):
        value = getattr(record, field.name)
        if isinstance(value, np.ndarray):
            value.flags.writeable = False
