# SPDX-License-Identifier: Apache-2.0
"""Silences NumPy's warnings of overflow and NaN, which the checks of results report instead."""

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

import numpy as np

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


def quiet(function: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
    """Return the function without NumPy's floating-point warnings on stderr."""

    @wraps(function)
    def call(*positional: Arguments.args, **named: Arguments.kwargs) -> Result:
        with np.errstate(all="ignore"):
            return function(*positional, **named)

    return call
