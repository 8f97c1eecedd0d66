# SPDX-License-Identifier: Apache-2.0
"""A new limit is one row of the table and a number in the rover file: all that judges obeys it."""

from itertools import pairwise

import numpy as np
import pytest

from rover_physics import (
    SweepOptions,
    judge_path,
    judge_pieces,
    judge_poses,
    load_rover,
    score_poses,
)
from rover_physics.errors import RoverFileError
from rover_physics.limits import table
from rover_physics.limits.table import NEWTONS, Limit
from rover_physics.names import WHEELS
from rover_physics.rover.rover_file import rover_from_dict, rover_to_dict
from rover_physics.traversability.pose_classes import IMPASSABLE, RoverOnMap, classify_poses
from rover_planner.planning.search.query import (
    LatticeSettings,
    SearchQuery,
    Site,
    read_query,
    write_query,
)
from rover_planner.studies.rover_values import find_key
from rover_planner.survey.layers import NO_LIMIT, number_limits
from rover_planner.survey.request import SurveyRequest
from rover_planner.survey.tile_survey import survey_tile
from rover_planner.viewer.state.path_limits import find_path_limits
from support.grounds import make_terrain, waves
from support.paths import poses_at

HEAVIEST = Limit(
    "wheel_load",
    "wheel_loads",
    "{element} wheel carries too much: {compared}",
    "heaviest",
    key="wheel_load",
    unit=NEWTONS,
    needs_forces=True,
)
"""The largest load of a wheel [N], as a team might add it."""
GROUND = make_terrain(waves)
PATH = poses_at(np.arange(-1.5, 1.5, 0.05), 0.3)


def rover_with(newtons: float):
    """Return a rover whose file has the number."""
    contents = rover_to_dict(load_rover("lsr1"))
    contents["limits"]["wheel_load"] = newtons
    return rover_from_dict(contents, "a test")


@pytest.fixture
def strict(monkeypatch):
    """Add the row; return a rover that carries less than some waypoints ask of a wheel."""
    monkeypatch.setattr(table, "LIMITS", (*table.LIMITS, HEAVIEST))
    loads = judge_path(load_rover("lsr1"), GROUND, PATH)[0].wheel_loads.max(axis=1)
    return rover_with(float(np.median(loads)))


def test_the_number_survives_files_and_without_it_the_limit_is_not_asked(strict, tmp_path):
    assert judge_path(load_rover("lsr1"), GROUND, PATH)[1].traversable
    again = rover_from_dict(rover_to_dict(strict), "again")
    assert again == strict and again.limits.further["wheel_load"] > 0.0
    key = ("limits", "wheel_load")
    assert find_key(rover_to_dict(strict), "limits.wheel_load") == (key, "")  # as studies ask
    asked = SearchQuery(Site(strict, GROUND), PATH[0], PATH[-1])
    write_query(tmp_path / "asked.npz", asked, LatticeSettings())
    assert read_query(tmp_path / "asked.npz")[0].site.rover == strict
    with pytest.raises(RoverFileError, match=r"limits\.wheel_load is .many."):
        rover_with("many")  # type: ignore[arg-type]


def test_the_verdict_obeys_it_and_names_the_wheel_and_the_page_has_a_lane_for_it(strict):
    prediction, verdict = judge_path(strict, GROUND, PATH)
    limit = strict.limits.further["wheel_load"]
    beyond = prediction.wheel_loads.max(axis=1) > limit
    assert beyond.any() and not beyond.all()
    assert [code == "wheel_load" for code in verdict.codes] == beyond.tolist()
    assert "wheel carries too much: " in verdict.reason and f"limit {limit:.2f}" in verdict.reason
    first = judge_path(strict, GROUND, PATH, stop_at_failure=True)[1]
    assert (first.first_failure, first.reason) == (verdict.first_failure, verdict.reason)
    limits = find_path_limits(strict, prediction, verdict)
    lane = limits.lane("wheel_load")
    assert lane.title == "heaviest"
    assert lane.bounds[0] == limit
    assert (lane.used > 1.0).tolist() == [False] * verdict.first_failure + [True]
    heaviest = WHEELS[prediction.wheel_loads[verdict.first_failure].argmax()]
    assert limits.find_link(lane, -1) == heaviest


def test_edges_of_the_search_and_scores_obey_it(strict):
    codes = judge_path(strict, GROUND, PATH)[1].codes
    pieces = [PATH[k : k + 2] for k in range(len(PATH) - 1)]
    found = [piece.code for piece in judge_pieces(strict, GROUND, pieces)]
    assert found == [a or b for a, b in pairwise(codes)]
    assert score_poses(strict, GROUND, PATH).passable.tolist() == [not code for code in codes]


def test_hazard_map_and_survey_obey_it(strict):
    codes = judge_poses(strict, GROUND, PATH)[1].codes
    refused = np.array([code == "wheel_load" for code in codes])
    classes = classify_poses(RoverOnMap(strict, GROUND, SweepOptions()), PATH, ["equal"])
    assert (classes == np.where(refused, IMPASSABLE, 0)).all()
    request = SurveyRequest(rover=strict, headings=1, options=SweepOptions())
    layers = survey_tile(request, GROUND, PATH[:, :2])
    expected = np.where(refused, number_limits()["wheel_load"], NO_LIMIT)
    assert (layers["first_limit"] == expected).all()
