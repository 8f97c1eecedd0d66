# SPDX-License-Identifier: Apache-2.0
"""Contents of a file become a type, or an error that names key, value and rule."""

from dataclasses import dataclass
from typing import Annotated, Any

import pytest

from rover_physics import RoverError
from rover_physics.errors import RoverFileError
from rover_physics.files import rules
from rover_physics.files.validation import describe, errors_of, read_as, show_key

Point = Annotated[
    tuple[rules.Metres, rules.Metres, rules.Metres],
    rules.Rule("a list of 3 numbers in m, [x, y, z] in the body frame"),
]


@dataclass(frozen=True)
class Leg:
    length: Annotated[float, rules.number("m", above=0.0, most=2.0)]
    swing: Annotated[tuple[float, float], rules.interval("rad")] = (-1.0, 1.0)


@dataclass(frozen=True)
class Walker:
    name: rules.Text
    hip: Point
    gait: Annotated[str, rules.choice("walk", "trot")]
    legs: Annotated[tuple[Leg, ...], rules.ListOfMappings()]
    feet: Annotated[dict[str, float], rules.Keys({"left": rules.Metres}, {"right": rules.Metres})]
    tail: Leg | None = None


def walker(**changes: Any) -> dict[str, Any]:
    data = {
        "name": "w", "hip": [0, 0.5, 1.0], "gait": "walk", "legs": [{"length": 1}],
        "feet": {"left": 0.1},
    }  # fmt: skip
    return data | changes


def test_contents_become_the_type_with_lists_as_tuples_and_integers_as_floats():
    read = read_as(Walker, walker(tail={"length": 2, "swing": [0, 1]}), "a walker file")
    assert read == Walker(
        "w", (0.0, 0.5, 1.0), "walk", (Leg(1.0),), {"left": 0.1}, Leg(2.0, (0.0, 1.0))
    )
    assert type(read.legs[0].length) is float


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"legs": [{"length": 3}]}, "legs[0].length is 3; it must be a number above 0 and at "
         "most 2 in m"),
        ({"legs": [{"length": 1}, {"lenght": 1}]}, "unknown key legs[1].lenght; did you mean "
         "length? legs[1] has length, swing"),
        ({"legs": [{}]}, "missing key legs[0].length; legs[0] needs length"),
        ({"legs": []}, "legs is []; it must be a list of one mapping or more"),
        ({"tail": {"length": 1, "swing": (1, 0)}}, "tail.swing is [1, 0]; it must be [lowest, "
         "highest] in rad, the first below the second"),
        ({"gait": "run"}, "gait is 'run'; it must be walk or trot"),
        ({"name": " "}, "name is ' '; it must be a text that is not empty"),
        ({"hip": {1, 2, 3}}, "hip is {1, 2, 3}; it must be a list of 3 numbers in m, [x, y, z] "
         "in the body frame"),
        ({"feet": {}}, "missing key feet.left; feet needs left"),
        ({"feet": {"left": 1, 7: 2}}, "unknown key feet.7; feet has left, right"),
        ({"colour": "red"}, "unknown key colour; a walker file has name, hip, gait, legs, feet, "
         "tail"),
    ],
)  # fmt: skip
def test_an_error_names_key_value_and_rule(changes, text):
    with pytest.raises(RoverFileError) as raised:
        read_as(Walker, walker(**changes), "a walker file")
    assert str(raised.value) == text


def test_errors_name_the_part_of_a_file_from_the_top_and_open_with_the_file():
    with pytest.raises(RoverFileError, match=r"^dune\.legs\[0\]\.length is 0; "):
        read_as(Walker, walker(legs=[{"length": 0}]), "a walker file", ("dune",))
    with pytest.raises(RoverFileError, match="^dune is 3; it must be a mapping with name, hip"):
        read_as(Walker, 3, "a walker file", ("dune",))
    with pytest.raises(RoverError, match="^mine: no key"), errors_of("mine"):
        raise RoverFileError("no key")


def test_long_values_and_keys_are_shown_briefly():
    for value in ("x" * 100, list(range(100)), {k: k for k in range(100)}):
        assert len(describe(value)) <= 60
        assert "..." in describe(value)
    assert show_key(("drives", 0, "length")) == "drives[0].length"
    assert show_key(("my soil", "n")) == "my soil.n"
    assert len(show_key(("x" * 1000,))) <= 60
