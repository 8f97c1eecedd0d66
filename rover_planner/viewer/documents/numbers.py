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
    unknown = np.array(None, object)
    return np.where(np.isfinite(array), array.astype(object), unknown).tolist()


def write(value: float, digits: int, unit: str = "") -> str:
    """Return a number as text with its unit, ? for NaN."""
    if math.isnan(value):
        return "?"
    return f"{value:.{digits}f} {unit}".rstrip() if abs(value) < 1e5 else "infinite"
