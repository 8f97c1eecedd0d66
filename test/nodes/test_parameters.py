"""One table makes declaration, checks and documentation; bad values are refused."""

import math
from pathlib import Path

import pytest
from rclpy.node import Node
from rclpy.parameter import Parameter

from rover_planner.errors import PlanningError
from rover_planner.parameters.declare import check_changes, declare_parameters
from rover_planner.parameters.document import parameters_document
from rover_planner.parameters.of_traverse_server import TRAVERSE_SERVER
from rover_planner.parameters.spec import ParameterError, ParameterSpec


@pytest.fixture
def make_node(ros):
    nodes = []

    def make(**overrides):
        node = Node(
            "parameter_test",
            context=ros.context,
            parameter_overrides=[
                Parameter(name, value=value) for name, value in overrides.items()
            ],
        )
        nodes.append(node)
        return node

    yield make
    for node in nodes:
        node.destroy_node()


def spec_of(name):
    return next(spec for spec in TRAVERSE_SERVER if spec.name == name)


def test_the_docs_agree_with_the_table():
    docs = Path(__file__).resolve().parents[2] / "docs" / "parameters.md"
    assert docs.read_text() == parameters_document(), (
        "run: python -m rover_planner.parameters > docs/parameters.md"
    )


def test_names_are_unique_and_defaults_are_allowed():
    assert len({spec.name for spec in TRAVERSE_SERVER}) == len(TRAVERSE_SERVER)
    for spec in TRAVERSE_SERVER:
        spec.check(spec.default)


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("friction", math.nan, "friction is nan; it must be a finite number"),
        ("friction", math.inf, "friction is inf; it must be a finite number"),
        ("friction", -0.1, "friction is -0.1; it must be in 0 to 10"),
        ("friction", "rough", "friction is 'rough'; it must be of type double"),
        ("friction", 1, "friction is 1; it must be of type double, such as 0.0"),
        ("candidate_count", 0, "candidate_count is 0; it must be in 1 to 99"),
        ("candidate_count", True, "candidate_count is True; it must be of type integer"),
        ("candidate_count", None, "candidate_count is None; it must be of type integer"),
        ("candidate_spacing", [0.3], r"candidate_spacing is \[0.3\]; it must be of type double"),
        ("waypoint_spacing", 0.0, r"waypoint_spacing is 0.0; it must be in 0.001 to 1 m"),
        ("policy", "fair", "policy is 'fair'; it must be one of equal, optimal"),
        ("unknown_cells", "ask", "unknown_cells is 'ask'; it must be one of refuse, interpolate"),
        ("map_frame", "", "map_frame is empty; it must be a text such as 'map'"),
    ],
)
def test_a_bad_value_is_refused_by_name(name, value, text):
    with pytest.raises(ParameterError, match=text):
        spec_of(name).check(value)


def test_parameters_are_declared_as_the_table_says(make_node):
    node = make_node(friction=0.6)
    values = declare_parameters(node, TRAVERSE_SERVER)
    assert values == {spec.name: spec.default for spec in TRAVERSE_SERVER} | {"friction": 0.6}
    for spec in TRAVERSE_SERVER:
        descriptor = node.describe_parameter(spec.name)
        assert descriptor.description.startswith(spec.doc)
        assert descriptor.read_only == spec.read_only
        ranges = descriptor.floating_point_range or descriptor.integer_range
        assert [(r.from_value, r.to_value) for r in ranges] == (
            [spec.bounds] if spec.bounds else []
        )


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("friction", math.nan),
        ("friction", -1.0),
        ("friction", 1),
        ("policy", "fair"),
        ("candidate_count", 9.0),
    ],
)
def test_a_bad_override_is_refused_at_the_start(make_node, name, value):
    with pytest.raises(ParameterError, match=f"parameter {name}"):
        declare_parameters(make_node(**{name: value}), TRAVERSE_SERVER)


def test_a_bad_change_leaves_the_value_and_says_why(make_node):
    node = make_node()
    values = declare_parameters(node, TRAVERSE_SERVER)
    seen = []
    node.add_on_set_parameters_callback(check_changes(TRAVERSE_SERVER, values, seen.append))

    def change(name, value):
        return node.set_parameters([Parameter(name, value=value)])[0]

    for name, value, text in [
        ("friction", math.nan, "value: nan"),
        ("friction", "rough", "Wrong parameter type"),
        ("friction", 99.0, "friction"),
        ("policy", "fair", "one of equal, optimal"),
        ("map_frame", "odom", "read-only"),
    ]:
        result = change(name, value)
        assert not result.successful and text in result.reason
        assert node.get_parameter(name).value == spec_of(name).default
    assert seen == []
    assert change("friction", 0.5).successful
    assert seen == [values | {"friction": 0.5}]


def test_what_the_node_cannot_accept_is_refused_with_its_reason(make_node):
    def accept(values):
        raise PlanningError(f"no rover {values['rover']}")

    node = make_node()
    values = declare_parameters(node, TRAVERSE_SERVER)
    node.add_on_set_parameters_callback(check_changes(TRAVERSE_SERVER, values, accept))
    result = node.set_parameters([Parameter("rover", value="lsr9")])[0]
    assert not result.successful and result.reason == "no rover lsr9"
    assert node.set_parameters([Parameter("use_sim_time", value=False)])[0].successful


def test_the_type_of_a_parameter_is_that_of_its_default():
    assert [ParameterSpec("p", default, "").type_name for default in ("", 0.0, 1, True)] == [
        "string",
        "double",
        "integer",
        "bool",
    ]
