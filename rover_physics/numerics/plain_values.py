# SPDX-License-Identifier: Apache-2.0
"""Conversion of results to JSON types."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

_PLAIN = (str, int, bool, type(None))


def to_plain(value: Any) -> Any:
    """Return a value as JSON types: arrays as lists, numbers that are not finite as None."""
    if type(value) in _PLAIN:
        return value
    if isinstance(value, Mapping):
        return {str(key): to_plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return to_plain(value.tolist())
    if isinstance(value, list | tuple):
        return [to_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
