# SPDX-License-Identifier: Apache-2.0
"""The report has one flat set of keys, in one order, that docs/traverse_server.md tells of."""

import json
import math
import re
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from types import NoneType
from typing import get_args, get_type_hints

import numpy as np
import pytest

from rover_physics.names import SUSPENSION_JOINTS
from rover_planner.parameters.traverse_server import TraverseServerParameters
from rover_planner.planning.answering.budget import QuestionStoppedError
from rover_planner.planning.answering.identity import Register
from rover_planner.planning.answering.judgement import refusal
from rover_planner.planning.answering.service_settings import load_service_settings
from rover_planner.planning.answering.traverse_service import TraverseService
from rover_planner.planning.path_report import REPORTED
from rover_planner.planning.verdict_report import VerdictReport, WaypointLists
from support.grounds import make_terrain, wall_at

DOCS = Path(__file__).parents[3] / "docs" / "traverse_server.md"
LISTS = [field.name for field in fields(WaypointLists)]


def keys_of(kind) -> list[str]:
    """Return the keys of a report by its types."""
    keys = []
    for name, hint in get_type_hints(kind).items():
        part = next((kind for kind in get_args(hint) if kind is not NoneType), hint)
        if name == "extremes":
            keys += REPORTED
        else:
            keys += keys_of(part) if is_dataclass(part) else [name]
    return keys


KEYS = keys_of(VerdictReport)


@pytest.fixture(scope="module")
def full():
    """Return the judgement of a refused request about which all there is can be said."""
    parameters = TraverseServerParameters(candidate_count=2, planner="fan")
    service = TraverseService(load_service_settings(parameters))
    service.take_terrain(make_terrain(wall_at(0.5)))
    service.take_joints(dict.fromkeys(SUSPENSION_JOINTS, 0.0))
    service.take_pose(np.array([-2.0, 0.0, 0.0]))
    return service.answer((-2.0, 0.0, 0.0), (2.0, 0.0, 0.0))


@pytest.fixture(scope="module")
def identified(full):
    """Return the full report with what it is about."""
    service = TraverseService(load_service_settings(TraverseServerParameters()))
    service.take_terrain(make_terrain(wall_at(0.5)))
    identity = Register().identify(1, "can_traverse", "ab", service.situation())
    return replace(full.report, identity=identity)


def test_all_keys_are_there_once_where_all_can_be_said(identified):
    assert len(set(KEYS)) == len(KEYS)
    assert list(identified.to_dict()) == KEYS


def test_verdict_code_and_reason_come_first_and_the_long_lists_last(full):
    told = list(json.loads(json.dumps(full.report.to_dict())))
    assert told[:3] == ["traversable", "code", "reason"]
    assert told[-len(LISTS) :] == LISTS


def test_the_summary_lacks_nothing_but_the_lists(full):
    told = full.report.to_dict()
    assert full.report.summary() == {key: told[key] for key in told if key not in LISTS}
    assert {len(told[key]) for key in LISTS} == {told["waypoints"]}


def test_the_report_says_what_the_model_found(full):
    told, verdict = full.report.to_dict(), full.complete().candidate.verdict
    for name, value in verdict.to_dict().items():
        assert told[name] == value
    np.testing.assert_array_equal(
        told["failure_pose"], full.candidate.poses[verdict.first_failure]
    )
    assert told["traversability_class"] == "impassable"
    assert told["class_waypoint"] == told["traversability_classes"].index("impassable")
    assert told["goal"] == [2.0, 0.0, 0.0] and told["candidates"] == 2


def test_a_refused_candidate_ends_at_its_failure_until_the_judgement_is_complete(full):
    first, whole = full.candidate, full.complete().candidate
    failure = first.verdict.first_failure
    assert len(first.prediction.poses) == failure + 1 < len(first.poses)
    assert len(whole.prediction.poses) == len(whole.poses) == len(first.poses)
    assert (whole.verdict.first_failure, whole.verdict.reason) == (failure, full.reason)


def test_without_time_for_the_rest_the_report_ends_at_the_failure(full):
    def no_time():
        raise QuestionStoppedError("too_slow", "no time is left")

    hasty = replace(full, judge_rest=no_time).complete()
    told = hasty.report.to_dict()
    assert told["reason"] == full.reason and told["waypoints"] == len(full.candidate.poses)
    assert len(told["codes"]) == told["first_failure"] + 1
    assert told["time"] is None and told["energy"] is None


def test_a_refusal_says_why_and_nothing_of_a_path():
    assert refusal("no_map", "no map was received yet").report.to_dict() == {
        "traversable": False,
        "code": "no_map",
        "reason": "no map was received yet",
        "first_failure": -1,
    }


def test_numbers_that_json_lacks_become_null(full):
    extremes = dict(full.report.path.extremes) | {"tilt_bound": -math.inf}
    path = replace(full.report.path, energy=math.nan, extremes=extremes)
    told = replace(full.report, path=path).to_dict()
    assert told["energy"] is None and told["tilt_bound"] is None
    json.dumps(told, allow_nan=False)


def test_the_report_and_its_classes_are_computed_once_and_when_asked_for(full):
    asked = []

    def classify():
        asked.append(1)
        return full.classes

    judgement = replace(full, classify=classify)
    assert judgement.summary().startswith("refused") and not judgement.traversable
    assert asked == []
    assert judgement.report is judgement.report
    judgement.changes()
    assert asked == [1]


def test_the_docs_have_the_keys_of_the_report_and_no_other():
    text = DOCS.read_text()
    table = text[text.index("| key | meaning |") :]
    rows = table[: table.index("\n\n")].splitlines()[2:]
    told = [key for row in rows for key in re.findall(r"`(\w+)`", row.split("|")[1])]
    assert sorted(told) == sorted(KEYS)
