# SPDX-License-Identifier: Apache-2.0
"""Rules for the values of configuration files, written in type annotations.

A field such as ``radius: Annotated[float, number("m", above=0.0)]`` defines a key completely:
pydantic checks it, and errors quote the rule. pydantic is imported only when a file is read.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
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

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        """Refuse values of another type or that break the rule; the error quotes the rule."""
        from pydantic_core import core_schema

        schema: Any = {**handler(source), "strict": True}
        if schema["type"] == "tuple":
            schema = core_schema.no_info_before_validator_function(_list_to_tuple, schema)
        schema = core_schema.no_info_after_validator_function(self._check, schema)
        return core_schema.custom_error_schema(schema, "rule", custom_error_message=self.must)

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> dict[str, Any]:
        """Add the rule to the description of the type."""
        return {**handler(schema), "rule": self}

    def _check(self, value: Any) -> Any:
        if not self.holds(value):
            raise ValueError(self.must)
        return value


@dataclass(frozen=True)
class ListOfMappings:
    """A list of one or more mappings; each mapping has its own errors."""

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        """Refuse an empty list or another type before the mappings are checked."""
        from pydantic_core import PydanticCustomError, core_schema

        def check(value: Any) -> Any:
            if not isinstance(value, list) or not value:
                raise PydanticCustomError("rule", "a list of one mapping or more")
            return value

        return core_schema.no_info_before_validator_function(check, handler(source))


@dataclass(frozen=True, eq=False)
class Keys:
    """The keys of a dict, with the type of each value."""

    required: Mapping[str, Any]
    """Required keys."""
    optional: Mapping[str, Any] = field(default_factory=dict)
    """Optional keys."""

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        """Accept a dict with these keys."""
        from pydantic_core import core_schema

        return core_schema.typed_dict_schema(
            {
                key: core_schema.typed_dict_field(
                    handler.generate_schema(kind), required=key in self.required
                )
                for key, kind in {**self.required, **self.optional}.items()
            }
        )


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


def _list_to_tuple(value: Any) -> Any:
    """Return lists and NumPy arrays as tuples, and other values unchanged."""
    value = value.tolist() if hasattr(value, "tolist") else value
    return tuple(value) if isinstance(value, list) else value
