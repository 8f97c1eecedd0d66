# SPDX-License-Identifier: Apache-2.0
"""The rover file: presets, every wrong input, and what the numbers add up to."""

import copy
from typing import Any

import pytest
import yaml

from rover_physics import Rover, RoverError, load_rover
from rover_physics.errors import RoverFileError
from rover_physics.files.config_files import find_config
from rover_physics.rover.model import Steering
from rover_physics.rover.rover_file import preset_names, rover_from_dict, rover_to_dict
from rover_physics.rover.uncertainty import Uncertainty

NAN, INF = float("nan"), float("inf")
OPTIONAL = ("manipulator", "manipulator.payload", "steering", "wheel.servo_droop")
"""Keys of the lsr1 file that may be left out."""


LSR1 = yaml.safe_load(find_config("rovers/lsr1.yaml").read_text(encoding="utf-8"))


def read(key: str, *value: object) -> Rover:
    """Read the lsr1 file with one dotted key set, or left out without a value."""
    data = place = copy.deepcopy(LSR1)
    *sections, last = key.split(".")
    for section in sections:
        place = place.setdefault(section, {})
    place.pop(last, None)
    if value:
        (place[last],) = value
    return rover_from_dict(data, "test")


def refusal(key: str, *value: object) -> str:
    """Return the error of the lsr1 file with one dotted key set or left out, one line."""
    with pytest.raises(RoverFileError) as raised:
        read(key, *value)
    text = str(raised.value)
    assert text.startswith("test: ") and "\n" not in text
    return text.removeprefix("test: ")


def all_keys(data: dict[str, Any], path: str = "") -> dict[str, Any]:
    """Return the values of a nested mapping by their dotted keys."""
    found = {}
    for name, value in data.items():
        found[path + name] = value
        if isinstance(value, dict):
            found |= all_keys(value, f"{path}{name}.")
    return found


def test_presets_have_the_numbers_of_the_contract():
    assert preset_names() == ("lsr1", "m2020")
    lsr1, m2020 = load_rover("lsr1"), load_rover("m2020")
    assert lsr1.suspension.bogie_wheels == ("middle", "front")
    assert lsr1.total_mass == pytest.approx(8.3, abs=1e-12)
    assert lsr1.weight == pytest.approx(8.3 * 9.81, abs=1e-9)
    assert (m2020.total_mass, m2020.gravity) == (1025.0, 3.71)
    assert m2020.suspension.bogie_wheels == ("rear", "middle")
    assert lsr1.steering == m2020.steering == Steering(("rear", "front"), 1.57, 0.35)


def test_optional_keys_may_be_left_out_or_empty_and_integers_are_numbers():
    for value in ((), (None,)):
        assert read("manipulator", *value).manipulator is None
        assert read("steering", *value).steering is None
    assert read("manipulator.payload").manipulator.payload == 0.0
    assert read("wheel.servo_droop").wheel.servo_droop == 0.3
    assert read("wheel.servo_droop", 0).wheel.servo_droop == 0.0
    limits = [[-3.2, 3.2], [-1.0, 1.5], [0.0, 2.5]]
    arm = read("manipulator.joint_limits", limits).manipulator
    assert arm.joint_limits == tuple(map(tuple, limits))
    assert read("manipulator.joint_limits").manipulator.joint_limits is None
    assert read("uncertainty.friction", 0.2).uncertainty == Uncertainty(friction=0.2)


@pytest.mark.parametrize("key", [key for key in all_keys(LSR1) if key not in OPTIONAL])
def test_a_missing_key_is_named(key):
    text = refusal(key)
    assert text.startswith(f"missing key {key};")
    assert key.split(".")[-1] in text.partition(" needs ")[2]


@pytest.mark.parametrize("wrong", [NAN, INF, True, "much", [1.0], 10**400, -1e3])
def test_every_number_is_a_finite_number_of_its_sign(wrong):
    numbers = [key for key, value in all_keys(LSR1).items() if isinstance(value, float)]
    assert len(numbers) > 20
    for key in numbers:
        assert refusal(key, wrong).startswith(f"{key} is ")


@pytest.mark.parametrize(
    ("key", "value", "must"),
    [
        *[("steering.wheels", value, "one or more of rear")
          for value in (["rear", "nose"], ["rear", "rear"], [])],
        ("suspension.rocker_wheel", "middle", "rear or front"),
        ("suspension.wheels.middle", [-0.5, 0.31, -0.2], "ahead of the rear wheel"),
        ("suspension.wheels.front", [0.1, 0.31, -0.2], "a wheel diameter, 0.2 m, ahead"),
        ("suspension.wheels.front", [0.4, -0.31, -0.2], "on the left side"),
        ("suspension.wheels.front", [0.4, 0.31, -0.25], "as high as the rear wheel"),
        ("suspension.bogie_pivot", [0.5, 0.31, -0.08], "between its two wheels, middle and front"),
        ("suspension.bogie_pivot", [0.2, -0.31, -0.08], "on the left side"),
        ("suspension.rocker_pivot", [0.1, 0.31, 0.0], "the origin of the body frame"),
        ("suspension.rocker_pivot", [0.0, -0.31, 0.0], "on the left side"),
        ("suspension.rocker_limits", [0.1, 0.2], "contain 0"),
        ("suspension.bogie_limits", [-4.0, 4.0], "within -3.14 to 3.14"),
        ("belly.z", -0.31, "above the ground under the wheels"),
        ("nominal_speed", 0.2, "at most wheel.max_speed x wheel.radius = 0.1"),
        *[("masses.body.com", value, "between the wheels")
          for value in ([1.0, 0.0, 0.05], [0.0, 0.9, 0.05])],
        ("uncertainty.mass", 2.0, "at most 0.35 of masses.body.mass, 1.75 kg"),
        ("uncertainty.friction", -0.1, "at least 0"),
        ("manipulator.joints", ["a", "b", "b"], "a list of 3 different names"),
        ("manipulator.joints", ["a", "b", "rocker_left"], "belongs to the suspension"),
        ("manipulator.link_lengths", [0.1, -0.3, 0.3], "negative"),
        ("manipulator.link_masses", [2.0, 2.0, 2.0], "together below masses.body.mass"),
        ("manipulator.joint_limits", [[-1.0, 1.0], [1.0, -1.0], [0.0, 1.0]], "3 intervals"),
    ],
)  # fmt: skip
def test_an_impossible_value_says_what_would_be_right(key, value, must):
    text = refusal(key, value)
    assert text.startswith(f"{key} is ")
    assert must in text.partition("; it must be ")[2]


def test_a_stowed_arm_outside_its_limits_and_pivots_of_a_bogie_behind_are_refused_alike():
    limits = [[-1.0, 1.0], [-1.0, 1.0], [0.0, 1.0]]
    must = "within manipulator.joint_limits, for arm_yaw"
    assert must in refusal("manipulator.joint_limits", limits)
    data = rover_to_dict(load_rover("m2020"))
    data["suspension"]["bogie_pivot"][0] = 0.1
    with pytest.raises(RoverFileError, match="between its two wheels, rear and middle"):
        rover_from_dict(data, "test")


def test_an_unknown_name_lists_the_keys_or_presets_that_there_are_or_where_was_searched():
    with pytest.raises(RoverFileError, match=r"limits\.tilted; did you mean tilt\?.* wheel_drop$"):
        read("limits.tilted", 1.0)
    with pytest.raises(RoverFileError, match="no rover 'lsr2'.*presets are lsr1, m2020"):
        load_rover("lsr2")
    with pytest.raises(RoverError, match=r"no configuration file 'rovers/none\.yaml'; searched /"):
        find_config("rovers/none.yaml")
