# SPDX-License-Identifier: Apache-2.0
"""The report has one flat set of keys, in one order, that docs/traverse_server.md tells of."""

import json
import re
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from rover_physics.names import SUSPENSION_JOINTS
from rover_physics.numerics.plain_values import to_plain
from rover_planner.planning.answering.budget import QuestionStoppedError
from rover_planner.planning.answering.judgement import PER_WAYPOINT, refusal
from rover_planner.planning.answering.questions import Register
from rover_planner.planning.answering.snapshot import GivenPath
from rover_planner.planning.search.judge import PathJudge
from support.grounds import make_terrain, wall_at
from support.services import make_service

DOCS = Path(__file__).parents[3] / "docs" / "traverse_server.md"


@pytest.fixture(scope="module")
def service():
    service = make_service(make_terrain(wall_at(0.5)), candidate_count=2, planner="fan")
    service.take_joints(dict.fromkeys(SUSPENSION_JOINTS, 0.0))
    service.take_pose(np.array([-2.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    return service


@pytest.fixture(scope="module")
def full(service):
    """Return the judgement of a refused request about which all there is can be said."""
    return service.snapshot().answer((-2.0, 0.0, 0.0), (2.0, 0.0, 0.0))


def test_the_docs_have_the_keys_of_a_full_report_and_no_other(full, service):
    identity = Register().identify("can_traverse", GivenPath(), service.snapshot())
    report = full.report | asdict(identity)
    text = DOCS.read_text()
    keys = text[text.index("\n- `traversable`") :]
    rows = keys[: keys.index("\n\n", 1)].split("\n- ")[1:]
    told = [key for row in rows for key in re.findall(r"`(\w+)`", row.split(":")[0])]
    assert sorted(told) == sorted(report)
    assert list(report)[:3] == ["traversable", "code", "reason"]


def test_the_lists_with_a_value_for_each_waypoint_are_known_by_their_keys(full):
    told = to_plain(full.report)
    lists = {key for key, value in told.items() if isinstance(value, list) and len(value) > 3}
    assert lists == set(PER_WAYPOINT)
    assert {len(told[key]) for key in lists} == {told["waypoints"]}


def test_the_report_says_what_the_model_found(full):
    told, verdict = to_plain(full.report), full.complete().candidate.verdict
    for name, value in verdict.to_dict().items():
        assert told[name] == (value if value != [] else [None] * told["waypoints"])
    assert told["failure_pose"] == full.candidate.poses[verdict.first_failure].tolist()
    assert told["traversability_class"] == "impassable"
    assert told["class_waypoint"] == told["traversability_classes"].index("impassable")
    assert told["goal"] == [2.0, 0.0, 0.0] and told["candidates"] == 2


def test_without_time_for_the_rest_the_report_ends_at_the_failure(full, monkeypatch):
    def no_time(_judge, _poses):
        raise QuestionStoppedError("too_slow", "no time is left")

    monkeypatch.setattr(PathJudge, "check", no_time)
    told = to_plain(replace(full).complete().report)
    assert told["reason"] == full.reason and told["waypoints"] == len(full.candidate.poses)
    assert len(told["codes"]) == told["first_failure"] + 1
    assert told["time"] is None and told["energy"] is None
    json.dumps(told, allow_nan=False)


def test_a_refusal_says_why_and_nothing_of_a_path():
    told = refusal("no_map", "no map yet").report
    why = {"traversable": False, "code": "no_map", "reason": "no map yet", "first_failure": -1}
    assert told == why
