# SPDX-License-Identifier: Apache-2.0
"""One table makes declaration, checks, docs and the typed values; bad values are refused."""

import math
from dataclasses import fields, replace
from functools import partial
from pathlib import Path
from typing import get_origin

import pytest
from rclpy.node import Node
from rclpy.parameter import Parameter

from rover_planner.errors import PlanningError
from rover_planner.parameters.__main__ import TABLES, parameters_document
from rover_planner.parameters.table import ParameterError, specs_of
from rover_planner.parameters.traverse_server import TraverseServerParameters
from rover_planner.ros.node import RoverNode, declare_parameters

BARE = partial(Node, "parameter_test")


def follow(ros, load=lambda values: None, apply=lambda made: None):
    """Return a node that follows changes and has the values in force."""
    node = ros.start(partial(RoverNode, "parameter_test", TraverseServerParameters))
    node.follow_changes(load, apply)
    return node


def change(node, name, value):
    return node.set_parameters([Parameter(name, value=value)])[0]


def test_the_docs_agree_with_the_tables():
    docs = Path(__file__).resolve().parents[2] / "docs" / "parameters.md"
    assert docs.read_text() == parameters_document(), (
        "run: python -m rover_planner.parameters > docs/parameters.md"
    )


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("friction", math.nan, "friction is nan; it must be a finite number"),
        ("friction", -0.1, "friction is -0.1; it must be in 0 to 10"),
        ("friction", "rough", "friction is 'rough'; it must be of type double"),
        ("friction", 1, "friction is 1; it must be of type double, such as 0.0"),
        ("waypoint_spacing", 1.1, r"waypoint_spacing is 1.1; it must be in 0 to 1 m"),
        ("waypoint_spacing", 0.0009, r"it must be 0, or at least 0\.001 m"),
        ("policy", "fair", "policy is 'fair'; it must be one of equal, servo, optimal"),
        ("map_frame", "", "map_frame is empty; it must be a text such as 'map'"),
        ("joint_map", ("a", ""), r"joint_map is \['a', ''\]; it must hold texts"),
        ("imu_mounting", (0.0, 0.0), "imu_mounting is .*; it must hold 3 finite doubles"),
    ],
)
def test_a_table_with_a_bad_value_cannot_be_made(name, value, text):
    with pytest.raises(ParameterError, match=text):
        replace(TraverseServerParameters(), **{name: value})


@pytest.mark.parametrize("table", TABLES.values())
def test_parameters_are_declared_as_the_table_says(ros, table):
    node = ros.start(BARE, friction=0.6)
    assert declare_parameters(node, table) == table(friction=0.6)
    for spec, field in zip(specs_of(table), fields(table), strict=True):
        assert type(spec.default) is (get_origin(field.type) or field.type)
        descriptor = node.describe_parameter(spec.name)
        assert descriptor.description.startswith(spec.meaning)
        assert descriptor.read_only == spec.read_only
        ranges = descriptor.floating_point_range or descriptor.integer_range
        found = [(one.from_value, one.to_value) for one in ranges]
        assert found == ([spec.bounds] if spec.bounds else [])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("friction:=-1.0", r"^parameter friction is -1.0; it must be in 0 to 10$"),
        ("joint_map:=[]", r"is \[\], which has no type in ROS; leave it out, its default is "),
        ("base_offset:=[]", r"is \[\]; it must hold 6 finite doubles"),
        ("imu_mounting:=[1, 0, 0]", r"is \[1, 0, 0\]; it must hold 3 finite doubles such as 0.0"),
    ],
)
def test_a_bad_override_is_refused_at_the_start_in_the_words_of_the_table(ros, text, said):
    node = ros.start(BARE, ["--ros-args", "-p", text])
    with pytest.raises(ParameterError, match=said):
        declare_parameters(node, TraverseServerParameters)


def test_a_bad_change_leaves_the_value_and_says_why(ros):
    seen = []
    node = follow(ros, seen.append)
    before = node.values
    for name, value, text in [
        ("friction", math.nan, "value: nan"),
        ("friction", "rough", "Wrong parameter type"),
        ("friction", 99.0, "friction"),
        ("map_frame", "odom", "read-only"),
    ]:
        result = change(node, name, value)
        assert not result.successful and text in result.reason
        assert node.get_parameter(name).value == getattr(before, name)
    assert seen == [] and node.values is before
    assert change(node, "friction", 0.5).successful
    assert seen == [node.values] and node.values == replace(before, friction=0.5)


def test_changes_made_at_once_are_judged_together(ros):
    def accept(values):
        if values.friction < values.max_torque:
            raise PlanningError("friction is below max_torque" + 400 * "!")

    node = follow(ros, accept)
    changes = [Parameter("friction", value=2.0), Parameter("max_torque", value=1.0)]
    refused = node.set_parameters(changes[1:])[0]
    assert not refused.successful and len(refused.reason) == 300
    assert refused.reason.startswith("friction is below max_torque!")
    assert change(node, "use_sim_time", False).successful  # is none of the table
    assert node.set_parameters_atomically(changes).successful
    assert node.values == TraverseServerParameters(friction=2.0, max_torque=1.0)


def test_an_unexpected_error_in_a_check_is_a_refusal_and_one_in_a_change_is_not_the_end(ros):
    def fail(_values):
        raise ZeroDivisionError("a fault" * 100)

    node = follow(ros, fail)
    result = change(node, "friction", 0.5)
    assert not result.successful and len(result.reason) == 300
    assert result.reason.startswith("internal error: ZeroDivisionError: a fault")
    assert node.values.friction == 0.0
    other = follow(ros, apply=fail)
    assert change(other, "max_gap", 0.5).successful
