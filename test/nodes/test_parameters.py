"""One table makes declaration, checks, docs and the typed values; bad values are refused."""

import math
from dataclasses import FrozenInstanceError, dataclass, fields, replace
from pathlib import Path
from typing import get_origin

import pytest
from rclpy.node import Node
from rclpy.parameter import Parameter

from rover_planner.errors import PlanningError
from rover_planner.parameters.declare import declare_parameters, follow_changes
from rover_planner.parameters.document import TABLES, parameters_document
from rover_planner.parameters.rover_simulator import RoverSimulatorParameters
from rover_planner.parameters.shared import MAP_DURABILITIES
from rover_planner.parameters.table import ParameterError, ParameterTable, parameter, specs_of
from rover_planner.parameters.traction_controller import TractionControllerParameters
from rover_planner.parameters.traverse_server import TraverseServerParameters
from rover_planner.ros.qos import map_subscriptions_qos


@pytest.fixture
def make_node(ros):
    nodes = []

    def make(*words, **overrides):
        node = Node(
            "parameter_test",
            context=ros.context,
            cli_args=["--ros-args", *words],
            parameter_overrides=[
                Parameter(name, value=value) for name, value in overrides.items()
            ],
        )
        nodes.append(node)
        return node

    yield make
    for node in nodes:
        node.destroy_node()


def spec_of(name, table=TraverseServerParameters):
    return next(spec for spec in specs_of(table) if spec.name == name)


class Values:
    """The values in force, as a node holds them."""

    def __init__(self, node, accept=lambda values: None):
        self.value = declare_parameters(node, TraverseServerParameters)
        follow_changes(node, lambda: self.value, accept, self.take)

    def take(self, values):
        self.value = values


def test_the_docs_agree_with_the_tables():
    docs = Path(__file__).resolve().parents[2] / "docs" / "parameters.md"
    assert docs.read_text() == parameters_document(), (
        "run: python -m rover_planner.parameters > docs/parameters.md"
    )


@pytest.mark.parametrize("table", TABLES.values())
def test_defaults_are_of_the_type_of_their_field_and_allowed(table):
    assert table() == table()
    for spec, field in zip(specs_of(table), fields(table), strict=True):
        assert spec.meaning.endswith(".") and "|" not in spec.meaning
        expected = get_origin(field.type) or field.type
        assert type(spec.default) is expected


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
        ("policy", "fair", "policy is 'fair'; it must be one of equal, servo, optimal"),
        ("unknown_cells", "ask", "unknown_cells is 'ask'; it must be one of refuse, interpolate"),
        ("map_frame", "", "map_frame is empty; it must be a text such as 'map'"),
    ],
)
def test_a_table_with_a_bad_value_cannot_be_made(name, value, text):
    with pytest.raises(ParameterError, match=text):
        replace(TraverseServerParameters(), **{name: value})


def test_a_list_of_names_has_no_empty_one():
    with pytest.raises(ParameterError, match=r"joints is \['a', ''\]; it must hold texts"):
        TractionControllerParameters(joints=("a", ""))


@pytest.mark.parametrize("value", [(0.0, 0.0), (0.0, 0.0, math.nan), (0.0, 0.0, 9.0), (0, 0, 0)])
def test_an_array_of_numbers_has_its_length_finite_numbers_and_bounds(value):
    with pytest.raises(ParameterError, match=r"imu_mounting is .*; it must hold 3 finite numbers"):
        TractionControllerParameters(imu_mounting=value)


def test_an_array_of_numbers_is_taken_from_ros(make_node):
    node = make_node(imu_mounting=[0.1, 0.2, 0.3])
    values = declare_parameters(node, TractionControllerParameters)
    assert values.imu_mounting == (0.1, 0.2, 0.3)


def test_values_cannot_be_changed_in_place():
    with pytest.raises(FrozenInstanceError):
        TraverseServerParameters().friction = 0.5


def test_the_type_of_a_parameter_is_that_of_its_field():
    @dataclass(frozen=True)
    class Table(ParameterTable):
        text: str = parameter("", "A text.")
        number: float = parameter(0.0, "A number.", unit="m", bounds=(0.0, 1.0))
        count: int = parameter(1, "A count.")
        flag: bool = parameter(True, "A flag.")
        names: tuple[str, ...] = parameter(("a",), "Names.", read_only=True)

    assert [spec.type_name for spec in specs_of(Table)] == [
        "string",
        "double",
        "integer",
        "bool",
        "string array",
    ]
    assert [spec.default for spec in specs_of(Table)] == ["", 0.0, 1, True, ("a",)]
    assert spec_of("names", Table).ros_default == ["a"]
    assert spec_of("number", Table).bounds == (0.0, 1.0)


@pytest.mark.parametrize("table", TABLES.values())
def test_parameters_are_declared_as_the_table_says(make_node, table):
    node = make_node(friction=0.6)
    assert declare_parameters(node, table) == table(friction=0.6)
    for spec in specs_of(table):
        descriptor = node.describe_parameter(spec.name)
        assert descriptor.description.startswith(spec.meaning)
        assert descriptor.read_only == spec.read_only
        ranges = descriptor.floating_point_range or descriptor.integer_range
        assert [(r.from_value, r.to_value) for r in ranges] == (
            [spec.bounds] if spec.bounds else []
        )


def test_an_array_of_names_is_taken_from_ros(make_node):
    names = list(reversed(RoverSimulatorParameters().joints))
    values = declare_parameters(make_node(joints=names), RoverSimulatorParameters)
    assert values.joints == tuple(names)


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
        declare_parameters(make_node(**{name: value}), TraverseServerParameters)


def test_an_empty_list_is_refused_in_one_line(make_node):
    for name, text in (
        ("friction", r"is \[\]; it must be of type double"),
        ("joint_map", r"is \[\], which has no type in ROS; leave it out, its default is "),
        ("base_offset", r"is \[\]; it must hold 6 finite numbers"),
    ):
        with pytest.raises(ParameterError, match=f"parameter {name} {text}"):
            declare_parameters(make_node("-p", f"{name}:=[]"), TraverseServerParameters)


def test_a_bad_override_is_refused_in_the_words_of_the_table(make_node):
    words = "^parameter friction is 1; it must be of type double, such as 0.0$"
    with pytest.raises(ParameterError, match=words):
        declare_parameters(make_node(friction=1), TraverseServerParameters)
    words = r"^parameter friction is -1.0; it must be in 0 to 10$"
    with pytest.raises(ParameterError, match=words):
        declare_parameters(make_node(friction=-1.0), TraverseServerParameters)


def test_a_bad_change_leaves_the_value_and_says_why(make_node):
    node, seen = make_node(), []
    values = Values(node, seen.append)
    before = values.value

    def change(name, value):
        return node.set_parameters([Parameter(name, value=value)])[0]

    for name, value, text in [
        ("friction", math.nan, "value: nan"),
        ("friction", "rough", "Wrong parameter type"),
        ("friction", 99.0, "friction"),
        ("policy", "fair", "one of equal, servo, optimal"),
        ("map_frame", "odom", "read-only"),
    ]:
        result = change(name, value)
        assert not result.successful and text in result.reason
        assert node.get_parameter(name).value == spec_of(name).default
    assert seen == [] and values.value is before
    assert change("friction", 0.5).successful
    assert seen == [values.value] and values.value == replace(before, friction=0.5)


def test_changes_made_at_once_are_judged_together(make_node):
    def accept(values):
        if values.friction < values.max_torque:
            raise PlanningError("friction is below max_torque")

    node = make_node()
    values = Values(node, accept)
    changes = [Parameter("friction", value=2.0), Parameter("max_torque", value=1.0)]
    assert not node.set_parameters(changes[1:])[0].successful
    assert node.set_parameters_atomically(changes).successful
    assert values.value == TraverseServerParameters(friction=2.0, max_torque=1.0)


def test_what_the_node_cannot_accept_is_refused_with_its_reason(make_node):
    def accept(values):
        raise PlanningError(f"no rover {values.rover}")

    node = make_node()
    values = Values(node, accept)
    before = values.value
    result = node.set_parameters([Parameter("rover", value="lsr9")])[0]
    assert not result.successful and result.reason == "no rover lsr9"
    assert node.set_parameters([Parameter("use_sim_time", value=False)])[0].successful
    assert values.value is before


@pytest.mark.parametrize("durability", MAP_DURABILITIES)
def test_every_durability_of_maps_has_subscriptions(durability):
    assert map_subscriptions_qos(durability)


def test_an_unexpected_error_in_a_check_is_a_refusal(make_node):
    def fail(_values):
        raise ZeroDivisionError("a fault" * 100)

    node = make_node()
    values = Values(node, fail)
    result = node.set_parameters([Parameter("friction", value=0.5)])[0]
    assert not result.successful
    assert result.reason.startswith("internal error: ZeroDivisionError: a fault")
    assert len(result.reason) == 300
    assert values.value.friction == 0.0


def test_an_error_while_a_change_is_applied_does_not_end_the_node(make_node):
    def fail(_values):
        raise FileNotFoundError("gone since the check")

    node = make_node()
    values = declare_parameters(node, TraverseServerParameters)
    follow_changes(node, lambda: values, lambda _: None, fail)
    assert node.set_parameters([Parameter("max_gap", value=0.5)])[0].successful


@pytest.mark.parametrize("value", [1e-9, 0.0009])
def test_a_tiny_plan_spacing_is_refused_and_0_is_not(value):
    with pytest.raises(ParameterError, match=r"it must be 0, or at least 0\.001 m"):
        TraverseServerParameters(plan_spacing=value)
    assert TraverseServerParameters(plan_spacing=0.0).plan_spacing == 0.0
    assert TraverseServerParameters(plan_spacing=0.001).plan_spacing == 0.001
