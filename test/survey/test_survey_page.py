# SPDX-License-Identifier: Apache-2.0
"""A survey as layers of the page: its colours, its legend, and what is refused or said."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("viser", reason="no viser: pip install '.[view]'")
pytest.importorskip("zarr", reason="install the extra survey")

from rover_physics import SweepOptions, Terrain, load_rover
from rover_physics.prediction.sweep_options import DEFAULT_OPTIONS
from rover_physics.traversability.pose_classes import IMPASSABLE
from rover_planner.errors import PlanningError
from rover_planner.survey.layers import CLASS_COLOURS
from rover_planner.viewer.state.colours import UNKNOWN
from rover_planner.viewer.state.layers import CLASS, ShownSurvey, load_map
from support.rovers import LSR1
from support.survey_maps import make_request, survey_here

PASSABLE, WALL, HOLE = (1.5, 1.5), (4.55, 3.0), (1.5, 4.5)
"""Places on the map [m]."""


@pytest.fixture(scope="module")
def surveyed(tmp_path_factory):
    """Return a survey of flat ground with a wall and a hole, and its folder."""
    heights = np.zeros((60, 60))
    heights[:, 44:48] = 1.0
    heights[44:47, 14:17] = np.nan
    request = make_request(headings=2)
    folder = tmp_path_factory.mktemp("survey")
    return survey_here(folder, Terrain(heights, 0.1), request).store.path


@pytest.fixture(scope="module")
def shown(surveyed):
    return ShownSurvey(surveyed, LSR1, load_map(surveyed, 10_000))


def look_at(shown, x, y):
    """Return the colour of a place, and the legend."""
    found = shown.colour(CLASS, LSR1, DEFAULT_OPTIONS, (np.array([x]), np.array([y])))
    return tuple(found.colours[0, 0].tolist()), str(found.legend)


def test_classes_have_the_colours_of_the_picture_and_a_legend_of_those_that_are_there(shown):
    passable, impassable = (tuple(bytes.fromhex(CLASS_COLOURS[k][1:])) for k in (0, IMPASSABLE))
    for place, colour in ((WALL, impassable), (HOLE, UNKNOWN), ((-3.0, 1.0), UNKNOWN)):
        assert look_at(shown, *place)[0] == colour
    found, legend = look_at(shown, *PASSABLE)
    assert found == passable
    assert "impassable" in legend and "traction control" not in legend
    assert "2 headings" in legend and "not as on the page" not in legend


def test_what_differs_from_the_page_is_said(shown):
    assert shown.find_differences(LSR1, SweepOptions()) == ()
    assert shown.find_differences(LSR1, SweepOptions(joint_angles={})) == ()
    changed = replace(LSR1, friction=0.5)
    said = shown.find_differences(changed, SweepOptions(policy="servo", soil="dry sand"))
    assert said[0] == "the rover was changed since"
    assert "torque policy equal in the survey, servo here" in said
    assert any(one.startswith("soil") for one in said)


@pytest.mark.parametrize(
    ("rover", "heights", "said"),
    [
        (load_rover("m2020"), None, "a survey of lsr1, not m2020"),
        (replace(LSR1, friction=0.5), None, "a survey of another lsr1"),
        (LSR1, np.zeros((60, 60)), "another map, or of one with other gaps"),
    ],
)
def test_a_survey_of_another_rover_or_map_is_refused(surveyed, rover, heights, said):
    with pytest.raises(PlanningError, match="60 x 60 cells; --max-cells is 100"):
        load_map(surveyed, 100)
    terrain = load_map(surveyed, 10_000) if heights is None else Terrain(heights, 0.1)
    with pytest.raises(PlanningError, match=said):
        ShownSurvey(surveyed, rover, terrain)
