# SPDX-License-Identifier: Apache-2.0
"""Rules for the values of configuration files, written in type annotations.

A field such as ``radius: Annotated[float, number("m", above=0.0)]`` defines a key completely:
`read_as` checks it, and errors quote the rule.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated, Any


@dataclass(frozen=True)
class Rule:
    """A condition on a value, in addition to its annotated type."""

    must: str
    """The rule as an error quotes it, after "it must be"."""
    unit: str = ""
    """Unit of the number, empty if it has none."""
    holds: Callable[[Any], object] = lambda value: True
    """Returns whether a value of the right type keeps the rule."""


@dataclass(frozen=True)
class ListOfMappings:
    """A list of one or more mappings; each mapping has its own errors."""


@dataclass(frozen=True, eq=False)
class Keys:
    """The keys of a dict, with the type of each value."""

    required: Mapping[str, Any]
    """Required keys."""
    optional: Mapping[str, Any] = field(default_factory=dict)
    """Optional keys."""

    @cached_property
    def all(self) -> dict[str, Any]:
        """All keys."""
        return {**self.required, **self.optional}


def number(
    unit: str,
    *,
    above: float = -math.inf,
    least: float = -math.inf,
    most: float = math.inf,
    below: float = math.inf,
) -> Rule:
    """Return the rule of a finite number within bounds; `above` and `below` are exclusive."""
    named = (("above", above), ("at least", least), ("at most", most), ("below", below))
    bounds = " and ".join(f"{name} {bound:g}" for name, bound in named if math.isfinite(bound))
    words = "a number", bounds, f"in {unit}" if unit else ""
    return Rule(
        " ".join(filter(None, words)),
        unit,
        lambda value: math.isfinite(value) and above < value < below and least <= value <= most,
    )


def interval(unit: str) -> Rule:
    """Return the rule of two numbers in ascending order."""
    must = f"[lowest, highest] in {unit}, the first below the second"
    return Rule(must, unit, lambda ends: ends[0] < ends[1])


def choice(*names: str) -> Rule:
    """Return the rule of a text that is one of the names."""
    return Rule(" or ".join(names), holds=names.__contains__)


Text = Annotated[str, Rule("a text that is not empty", holds=str.strip)]
Metres = Annotated[float, number("m")]
Radians = Annotated[float, number("rad")]
Point = Annotated[
    tuple[Metres, Metres, Metres], Rule("a list of 3 numbers in m, [x, y, z] in the body frame")
]
"""A position in [m]."""
