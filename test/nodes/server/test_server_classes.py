"""The traverse server classes paths, whichever policy it assumes; soil and payload count."""

import json
from dataclasses import fields

import numpy as np
import pytest

from msg_adapters.results.markers import WITH_SPEED_SERVOS as LIME
from rover_physics.names import WHEELS
from rover_physics.traversability.classification import (
    IMPASSABLE,
    PASSABLE,
    WITH_SPEED_SERVOS,
)
from rover_planner.planning.verdict_report import WaypointLists
from support.grounds import make_terrain, waves
from support.planner_client import ask

LISTS = {field.name for field in fields(WaypointLists)}
PATH = [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]


def slope(x, y):
    """Return a slope of 24 degrees: speed servos climb it, equal torques do not."""
    return 0.45 * x


def check(client, server, poses=PATH) -> dict:
    return json.loads(client.check_poses(server, poses).message)


@pytest.mark.parametrize(
    ("policy", "traversable"), [("equal", False), ("servo", True), ("optimal", True)]
)
def test_the_class_is_named_whichever_policy_is_assumed(server, client, policy, traversable):
    client.send_terrain(make_terrain(slope))
    assert client.set_parameter("policy", policy)[0]
    verdict = check(client, server)
    assert verdict["traversable"] == traversable and verdict["policy"] == policy
    assert verdict["traversability_class"] == WITH_SPEED_SERVOS
    assert verdict["class_constraint"] == "friction" and verdict["class_wheel"] in WHEELS
    assert 0.0 < verdict["class_margin"] < 1.0
    assert {len(verdict[key]) for key in LISTS} == {verdict["waypoints"]}
    assert set(verdict["traversability_classes"]) == {WITH_SPEED_SERVOS}


def test_a_plan_has_a_pose_where_the_class_changes(server, client):
    client.send_terrain(make_terrain(lambda x, y: 0.45 * np.maximum(x - 0.13, 0.0)))
    for name, value in {"policy": "optimal", "plan_spacing": 50.0, "candidate_count": 1}.items():
        assert client.set_parameter(name, value)[0]
    plan = client.can_traverse((-1.5, 0.0, 0.0), (1.5, 0.0, 0.0))
    verdict = check(client, server, [[-1.5, 0.0, 0.0], [1.5, 0.0, 0.0]])
    classes = np.array(verdict["traversability_classes"])
    changes = np.flatnonzero(classes[1:] != classes[:-1]) + 1
    assert len(changes) and len(plan.poses) == 2 + len(changes)
    found = [pose.pose.position.x for pose in plan.poses[1:-1]]
    np.testing.assert_allclose(found, -1.5 + 0.02 * changes, atol=1e-9)


def test_the_drawn_path_is_coloured_by_class(server, client):
    client.send_terrain(make_terrain(slope))
    _, results = client.next_results(lambda: client.check_poses(server, PATH))
    line = next(marker for marker in results["markers"].markers if marker.ns == "path")
    drawn = {(colour.r, colour.g, colour.b) for colour in line.colors}
    assert len(drawn) == 1
    assert drawn.pop() == pytest.approx((LIME.r, LIME.g, LIME.b))


def test_an_easy_path_is_passable_with_the_margin_of_its_worst_waypoint(mapped, client):
    verdict = check(client, mapped)
    assert verdict["traversability_class"] == PASSABLE and verdict["class_reason"] == ""
    assert verdict["class_margin"] == pytest.approx(min(verdict["class_margins"]))
    assert verdict["class_margin"] == verdict["class_margins"][verdict["class_waypoint"]]


def test_an_impassable_path_is_classified_by_its_first_failure(mapped, client):
    verdict = check(client, mapped, [[3.0, 0.0, 0.0], [6.0, 0.0, 0.0]])
    assert (
        verdict["traversability_class"] == IMPASSABLE and verdict["class_constraint"] == "off_map"
    )
    assert verdict["class_waypoint"] == verdict["first_failure"]
    assert verdict["class_margin"] is None and verdict["class_wheel"] == ""


def test_plans_are_classified_too_and_the_status_has_the_summary_alone(mapped, client):
    verdict = ask(client)[1]
    assert verdict["traversability_class"] == PASSABLE
    assert not LISTS & verdict.keys()


def test_the_soil_of_the_server_counts_and_is_checked(server, client):
    client.send_terrain(make_terrain(waves))
    firm = check(client, server)
    assert firm["max_sinkage"] == 0.0
    assert client.set_parameter("soil", "dry_sand") == (True, "")
    sandy = check(client, server)
    assert sandy["max_sinkage"] > 0.001
    assert sandy["energy"] > 2.0 * firm["energy"]
    accepted, reason = client.set_parameter("soil", "snow")
    assert not accepted and "'snow'" in reason and "dry_sand" in reason
    assert client.set_parameter("soil", "") == (True, "")
    assert check(client, server)["max_sinkage"] == 0.0


def test_an_impossible_payload_is_refused(server, client):
    for value in (-0.5, float("nan")):
        accepted, reason = client.set_parameter("payload", value)
        assert not accepted and "payload" in reason
    assert client.set_parameter("rover", "m2020")[0]
    accepted, reason = client.set_parameter("payload", 3.0)
    assert not accepted and "no manipulator" in reason


def test_a_payload_is_carried_along_a_path(mapped, client):
    def weight() -> float:
        _, results = client.next_results(lambda: client.check_poses(mapped, PATH))
        return float(np.sum(results["wheel_loads"].data[:6]))

    light = weight()
    assert client.set_parameter("payload", 2.0)[0]
    assert weight() == pytest.approx(light + 2.0 * 9.81, rel=0.01)
