"""The rover file: presets, every wrong input, and what the numbers add up to."""

import copy
from pathlib import Path
from typing import Any

import pytest
import yaml

from rover_physics.errors import RoverError, RoverFileError
from rover_physics.files.config_files import find_config
from rover_physics.rover.model import Steering
from rover_physics.rover.rover_file import load_rover, preset_names, rover_from_dict

NAN, INF = float("nan"), float("inf")
OPTIONAL = ("manipulator", "manipulator.payload", "steering", "wheel.servo_droop")
"""Keys of the lsr1 file that may be left out."""


def lsr1() -> dict[str, Any]:
    return yaml.safe_load(find_config("rovers/lsr1.yaml").read_text(encoding="utf-8"))


def changed(key: str, value: object) -> dict[str, Any]:
    """Return the lsr1 file with one dotted key set."""
    data = copy.deepcopy(lsr1())
    *sections, last = key.split(".")
    place = data
    for section in sections:
        place = place[section]
    place[last] = value
    return data


def without(key: str) -> dict[str, Any]:
    """Return the lsr1 file with one dotted key left out."""
    data = copy.deepcopy(lsr1())
    *sections, last = key.split(".")
    place = data
    for section in sections:
        place = place[section]
    del place[last]
    return data


def all_keys(data: dict[str, Any], path: str = "") -> list[str]:
    """List the dotted keys of a nested mapping."""
    keys = []
    for name, value in data.items():
        keys.append(path + name)
        if isinstance(value, dict):
            keys += all_keys(value, f"{path}{name}.")
    return keys


def test_presets_are_lsr1_and_m2020():
    assert preset_names() == ("lsr1", "m2020")


def test_lsr1_has_the_numbers_of_the_contract():
    rover = load_rover("lsr1")
    assert rover.name == "lsr1"
    assert rover.wheel.radius == 0.10
    assert rover.suspension.rocker_wheel == "rear"
    assert rover.suspension.bogie_wheels == ("middle", "front")
    assert rover.suspension.wheels["rear"] == (-0.40, 0.31, -0.20)
    assert rover.masses.body.com == (0.0, 0.0, 0.05)
    assert rover.limits.belly_clearance == 0.02
    assert rover.total_mass == pytest.approx(8.3, abs=1e-12)
    assert rover.weight == pytest.approx(8.3 * 9.81, abs=1e-9)
    assert rover.manipulator is not None
    assert rover.manipulator.payload == 0.0


def test_m2020_weighs_1025_kg_and_has_its_bogie_behind():
    rover = load_rover("m2020")
    assert rover.total_mass == 1025.0
    assert rover.gravity == 3.71
    assert rover.suspension.bogie_wheels == ("rear", "middle")
    assert rover.suspension.bogie_pivot == (-0.754, 0.920, -0.230)


def test_a_rover_file_is_loaded_by_its_path(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump(changed("name", "mine")), encoding="utf-8")
    assert load_rover(path).name == "mine"
    assert load_rover(str(path)) == load_rover(path)


def test_the_joints_of_the_arm_may_have_limits():
    limits = [[-3.2, 3.2], [-1.0, 1.5], [0.0, 2.5]]
    arm = rover_from_dict(changed("manipulator.joint_limits", limits), "test").manipulator
    assert arm.joint_limits == ((-3.2, 3.2), (-1.0, 1.5), (0.0, 2.5))
    assert load_rover("lsr1").manipulator.joint_limits is None


@pytest.mark.parametrize(
    ("limits", "must"),
    [
        ([[-1.0, 1.0]], "a list of 3 intervals"),
        ([[-1.0, 1.0], [1.0, -1.0], [0.0, 1.0]], "a list of 3 intervals"),
        ([[-1.0, 1.0], "wide", [0.0, 1.0]], "a list of 3 intervals"),
        ([[-1.0, 1.0], [-1.0, 1.0], [0.0, 1.0]], "within manipulator.joint_limits, for arm_yaw"),
    ],
)
def test_impossible_joint_limits_are_refused(limits, must):
    with pytest.raises(RoverFileError, match=must):
        rover_from_dict(changed("manipulator.joint_limits", limits), "test")


def test_the_manipulator_may_be_left_out():
    assert rover_from_dict(without("manipulator"), "test").manipulator is None
    assert rover_from_dict(changed("manipulator", None), "test").manipulator is None


def test_the_presets_steer_their_rear_and_front_wheels():
    for name in preset_names():
        assert load_rover(name).steering == Steering(("rear", "front"), 1.57, 0.35)


def test_a_rover_without_a_section_steering_has_fixed_wheels():
    assert rover_from_dict(without("steering"), "test").steering is None
    assert rover_from_dict(changed("steering", None), "test").steering is None


def test_the_droop_of_the_servos_may_be_left_out():
    assert rover_from_dict(without("wheel.servo_droop"), "test").wheel.servo_droop == 0.3
    stiff = rover_from_dict(changed("wheel.servo_droop", 0), "test")
    assert stiff.wheel.servo_droop == 0.0


@pytest.mark.parametrize(
    ("key", "value", "must"),
    [
        ("wheels", ["rear", "nose"], "one or more of rear, middle, front, each once"),
        ("wheels", ["rear", "rear"], "one or more of rear, middle, front, each once"),
        ("wheels", [], "one or more of rear, middle, front, each once"),
        ("wheels", "front", "one or more of rear, middle, front, each once"),
        ("limit", 0.0, "at least 1e-06"),
        ("limit", -0.5, "at least 1e-06"),
        ("limit", 3.2, "at most 3.14159 in rad"),
        ("limit", NAN, "at most 3.14159 in rad"),
        ("rate", 0.0, "at least 1e-09"),
        ("rate", -0.1, "at least 1e-09"),
        ("rate", INF, "in rad/s"),
    ],
)
def test_impossible_steering_is_refused_by_its_key(key, value, must):
    with pytest.raises(RoverFileError, match=rf"^test: steering\.{key} is .*{must}"):
        rover_from_dict(changed(f"steering.{key}", value), "test")


@pytest.mark.parametrize("droop", [-0.1, 1.0, 2.0, NAN])
def test_a_droop_outside_0_to_below_1_is_refused(droop):
    with pytest.raises(RoverFileError, match=r"wheel\.servo_droop is .*at least 0 and below 1"):
        rover_from_dict(changed("wheel.servo_droop", droop), "test")


def test_the_payload_may_be_left_out():
    arm = rover_from_dict(without("manipulator.payload"), "test").manipulator
    assert arm is not None
    assert arm.payload == 0.0


def test_integers_are_numbers():
    assert rover_from_dict(changed("wheel.max_torque", 2), "test").wheel.max_torque == 2.0


@pytest.mark.parametrize("key", [key for key in all_keys(lsr1()) if key not in OPTIONAL])
def test_a_missing_key_is_named(key):
    with pytest.raises(
        RoverFileError, match=rf"missing key {key};.* needs .*{key.split('.')[-1]}"
    ):
        rover_from_dict(without(key), "test")


@pytest.mark.parametrize(
    "key",
    [
        "colour",
        "wheel.colour",
        "suspension.wheels.last",
        "masses.body.centre",
        "limits.roll",
        "manipulator.length",
    ],
)
def test_an_unknown_key_is_named(key):
    with pytest.raises(RoverFileError, match=f"unknown key {key};"):
        rover_from_dict(changed(key, 1.0), "test")


def test_a_misspelt_key_gets_a_suggestion():
    data = without("wheel.radius")
    data["wheel"]["radus"] = 0.1
    with pytest.raises(RoverFileError, match=r"unknown key wheel\.radus; did you mean radius\?"):
        rover_from_dict(data, "test")


NUMBERS = [
    "gravity",
    "friction",
    "nominal_speed",
    "wheel.radius",
    "wheel.width",
    "wheel.mass",
    "wheel.max_torque",
    "wheel.max_speed",
    "masses.body.mass",
    "masses.rocker.mass",
    "masses.bogie.mass",
    "limits.tilt",
    "limits.tip_over_ratio",
    "limits.friction_utilisation",
    "limits.torque_saturation",
    "limits.belly_clearance",
    "limits.wheel_drop",
    "manipulator.payload",
]


@pytest.mark.parametrize("value", [NAN, INF, -INF, -0.5, True, "much", [1.0], {}, 10**400])
@pytest.mark.parametrize("key", NUMBERS)
def test_a_number_must_be_finite_and_not_negative(key, value):
    with pytest.raises(RoverFileError, match=rf"test: {key} is .*; it must be a number"):
        rover_from_dict(changed(key, value), "test")


@pytest.mark.parametrize(
    "key",
    [
        "gravity",
        "friction",
        "nominal_speed",
        "wheel.radius",
        "wheel.width",
        "wheel.max_torque",
        "wheel.max_speed",
        "masses.body.mass",
        "limits.tilt",
        "limits.friction_utilisation",
        "limits.torque_saturation",
    ],
)
def test_some_numbers_must_be_above_zero(key):
    with pytest.raises(
        RoverFileError, match=f"{key} is 0.0; it must be a number (above|at least)"
    ):
        rover_from_dict(changed(key, 0.0), "test")


@pytest.mark.parametrize(
    "key", ["limits.tip_over_ratio", "limits.friction_utilisation", "limits.torque_saturation"]
)
def test_a_limit_on_a_share_is_at_most_one(key):
    with pytest.raises(RoverFileError, match=f"{key} is 1.1; it must be .* at most 1"):
        rover_from_dict(changed(key, 1.1), "test")


POINTS = [
    "suspension.rocker_pivot",
    "suspension.bogie_pivot",
    "suspension.wheels.rear",
    "masses.body.com",
    "masses.rocker.com",
    "masses.bogie.com",
    "manipulator.base",
]


@pytest.mark.parametrize("value", [[0.0, 0.3], [0.0, 0.3, NAN], [0.0, "0.3", 0.0], 0.3, "x", None])
@pytest.mark.parametrize("key", POINTS)
def test_a_position_is_three_finite_numbers(key, value):
    with pytest.raises(RoverFileError, match=rf"{key} is .*; it must be a list of 3 numbers in m"):
        rover_from_dict(changed(key, value), "test")


@pytest.mark.parametrize("value", [[0.2, -0.2], [0.1, 0.1], [-0.1], [-0.1, NAN], [True, 0.1]])
@pytest.mark.parametrize(
    "key", ["suspension.rocker_limits", "suspension.bogie_limits", "belly.x", "belly.y"]
)
def test_an_interval_is_a_lower_and_a_higher_number(key, value):
    with pytest.raises(RoverFileError, match=rf"{key} is .*\[lowest, highest\]"):
        rover_from_dict(changed(key, value), "test")


@pytest.mark.parametrize("key", ["wheel", "suspension", "suspension.wheels", "masses.body"])
@pytest.mark.parametrize("value", [None, 1.0, "text", [1, 2]])
def test_a_section_is_a_mapping(key, value):
    with pytest.raises(RoverFileError, match=rf"{key} is .*; it must be a mapping with "):
        rover_from_dict(changed(key, value), "test")


@pytest.mark.parametrize(
    ("key", "value", "must"),
    [
        ("name", "", "a text that is not empty"),
        ("name", 7, "a text that is not empty"),
        ("suspension.rocker_wheel", "middle", "rear or front"),
        ("suspension.rocker_wheel", ["rear"], "rear or front"),
        ("suspension.wheels.middle", [-0.5, 0.31, -0.2], "ahead of the rear wheel"),
        ("suspension.wheels.front", [0.1, 0.31, -0.2], "a wheel diameter, 0.2 m, ahead"),
        ("suspension.wheels.front", [0.4, -0.31, -0.2], "on the left side"),
        ("suspension.wheels.front", [0.4, 0.31, -0.25], "as high as the rear wheel"),
        ("suspension.bogie_pivot", [0.5, 0.31, -0.08], "between its two wheels, middle and front"),
        ("suspension.bogie_pivot", [-0.2, 0.31, -0.08], "between its two wheels"),
        ("suspension.bogie_pivot", [0.2, -0.31, -0.08], "on the left side"),
        ("suspension.rocker_pivot", [0.1, 0.31, 0.0], "the origin of the body frame"),
        ("suspension.rocker_pivot", [0.0, -0.31, 0.0], "on the left side"),
        ("suspension.rocker_limits", [0.1, 0.2], "contain 0"),
        ("suspension.bogie_limits", [-4.0, 4.0], "within -3.14 to 3.14"),
        ("belly.z", -0.31, "above the ground under the wheels"),
        ("nominal_speed", 0.2, "at most wheel.max_speed x wheel.radius = 0.1"),
        ("masses.body.com", [1.0, 0.0, 0.05], "between the wheels"),
        ("masses.body.com", [0.0, 0.9, 0.05], "between the wheels"),
        ("limits.tilt", 1.6, "at most 1.57"),
        ("manipulator.joints", ["a", "b"], "a list of 3 different names"),
        ("manipulator.joints", ["a", "b", "b"], "a list of 3 different names"),
        ("manipulator.joints", ["a", "b", 3], "a list of 3 different names"),
        ("manipulator.joints", ["a", "b", "rocker_left"], "belongs to the suspension"),
        ("manipulator.link_lengths", [0.1, -0.3, 0.3], "none of them negative"),
        ("manipulator.link_masses", [0.1, -0.3, 0.3], "none of them negative"),
        ("manipulator.link_masses", [2.0, 2.0, 2.0], "together below masses.body.mass"),
        ("manipulator.stowed", [0.0, 0.0], "a list of 3 numbers in rad"),
    ],
)
def test_an_impossible_value_says_what_would_be_right(key, value, must):
    with pytest.raises(RoverFileError) as raised:
        rover_from_dict(changed(key, value), "test")
    text = str(raised.value)
    assert text.startswith(f"test: {key} is ")
    assert must in text
    assert "\n" not in text


def test_pivots_of_a_bogie_behind_are_checked_alike():
    data = yaml.safe_load(find_config("rovers/m2020.yaml").read_text(encoding="utf-8"))
    data["suspension"]["bogie_pivot"][0] = 0.1
    with pytest.raises(RoverFileError, match="between its two wheels, rear and middle"):
        rover_from_dict(data, "test")


@pytest.mark.parametrize("text", ["1e-1", "'0.1'"])
def test_a_number_that_yaml_reads_as_text_gets_a_hint(tmp_path, text):
    path = write(tmp_path, preset_text().replace("radius: 0.10 ", f"radius: {text} "))
    with pytest.raises(RoverFileError, match=r"wheel\.radius .*YAML reads .* as text.*1\.0e-3"):
        load_rover(path)


def preset_text() -> str:
    return find_config("rovers/lsr1.yaml").read_text(encoding="utf-8")


def write(folder: Path, text: str) -> Path:
    path = folder / "rover.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_duplicate_key_is_named_with_its_lines(tmp_path):
    path = write(tmp_path, "name: a\ngravity: 9.81\nname: b\n")
    with pytest.raises(RoverFileError, match=r"rover\.yaml: duplicate key name in lines 1 and 3"):
        load_rover(path)


@pytest.mark.parametrize("text", ["", "- 1\n", "just text\n", "7\n"])
def test_a_file_that_is_no_mapping_is_refused(tmp_path, text):
    with pytest.raises(RoverFileError, match="the file is .*; it must be a mapping with name"):
        load_rover(write(tmp_path, text))


@pytest.mark.parametrize(
    "text",
    [
        "wheel: {radius: 0.1",
        "a: b: c",
        "!!python/object:os.system {}",
        "{[1]: 2}",
        "d: 2026-99-99",
    ],
)
def test_broken_yaml_is_refused_in_one_line(tmp_path, text):
    with pytest.raises(RoverFileError, match=r"rover\.yaml: not valid YAML") as raised:
        load_rover(write(tmp_path, text))
    assert "\n" not in str(raised.value)
    assert "<unicode string>" not in str(raised.value)


def test_an_unreadable_file_is_refused(tmp_path):
    with pytest.raises(RoverFileError, match="it is a directory; it must be a regular file"):
        load_rover(tmp_path)
    path = tmp_path / "binary.yaml"
    path.write_bytes(b"\xff\xfe\x00name")
    with pytest.raises(RoverFileError, match="not a text file in UTF-8"):
        load_rover(path)


def test_an_unknown_preset_lists_the_presets():
    with pytest.raises(RoverFileError, match="no rover 'lsr2'.*presets are lsr1, m2020"):
        load_rover("lsr2")


def test_an_unknown_configuration_file_says_where_was_searched():
    with pytest.raises(RoverError, match=r"no configuration file 'rovers/none\.yaml'; searched /"):
        find_config("rovers/none.yaml")
