# SPDX-License-Identifier: Apache-2.0
"""Numbers as the page shows them: rounded, and uses of limits as shares."""

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

MAX_USE = 99.0
"""Largest use that is written as a number."""


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


def write_use(use: float) -> str:
    """Return the use of a limit as text, such as "76 %"."""
    if np.isnan(use):
        return "not asked"
    if use > MAX_USE:
        return "fails" if np.isinf(use) else f"over {100.0 * MAX_USE:.0f} %"
    text = f"{100.0 * use:.0f} %"
    return "just above 100 %" if use > 1.0 and text == "100 %" else text
