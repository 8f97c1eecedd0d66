# SPDX-License-Identifier: Apache-2.0
"""Numbers as the front end gets them: rounded, and None where they are not known."""

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike


def plain(values: ArrayLike, digits: int = 3) -> Any:
    """Return numbers of any shape as nested lists with a number of digits.

    None stands for NaN and for what is infinite.
    """
    array = np.round(np.asarray(values, float), digits)
    known = np.isfinite(array)
    if known.all():
        return array.tolist()
    return np.where(known, array.astype(object), np.array(None, object)).tolist()


def write(value: float, digits: int, unit: str = "") -> str:
    """Return a number as text with its unit, ? for NaN."""
    if math.isnan(value):
        return "?"
    return f"{value:.{digits}f} {unit}".rstrip() if abs(value) < 1e5 else "infinite"
