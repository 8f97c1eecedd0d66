"""Pictures of answers are drawn for accepted and refused paths, on maps with and without holes."""

import dataclasses

import numpy as np
import pytest

pytest.importorskip("matplotlib", reason="needs matplotlib")

from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.grid import Terrain
from rover_planner.errors import PlanningError
from rover_planner.figures.plots import LabelledAnswer, draw_answers, hill_shade
from rover_planner.planning.path_query import PathQueryOptions, answer_path_query

COARSE = PathQueryOptions(count=3, spacing=0.4, waypoint_spacing=0.1)


@pytest.fixture(scope="module")
def rover():
    return load_rover("lsr1")


@pytest.fixture(scope="module")
def holed():
    elevation = np.zeros((81, 121))
    elevation[60:, 80:] = np.nan
    return Terrain(elevation, 0.1, (-6.0, -4.0))


def ask(rover, terrain, name, goal):
    return LabelledAnswer(
        name, "plain", answer_path_query(rover, terrain, (-4, 0, 0), goal, COARSE)
    )


def test_a_picture_shows_accepted_and_refused_answers(tmp_path, rover, holed):
    answers = [
        ask(rover, holed, "A", (0, 0, 0)),
        ask(rover, holed, "B", (4, 3, 0.5)),
        ask(rover, holed, "C", (9, 0, 0)),
    ]
    assert [one.answer.traversable for one in answers] == [True, False, False]
    path = tmp_path / "picture.png"
    draw_answers(path, rover, holed, answers, "title")
    assert path.read_bytes().startswith(b"\x89PNG")
    assert path.stat().st_size > 50_000


def test_refused_answers_alone_are_drawn_too(tmp_path, rover, holed):
    path = tmp_path / "picture.png"
    draw_answers(path, rover, holed, [ask(rover, holed, "A", (9, 0, 0))])
    assert path.stat().st_size > 10_000


def test_a_start_off_the_map_is_drawn_without_any_settled_pose(tmp_path, rover, holed):
    answer = answer_path_query(rover, holed, (50, 50, 0), (52, 50, 0), COARSE)
    path = tmp_path / "picture.png"
    draw_answers(path, rover, holed, [LabelledAnswer("A", "off", answer)])
    assert path.stat().st_size > 10_000


def test_a_single_pose_is_drawn(tmp_path, rover, holed):
    answer = answer_path_query(rover, holed, (0, 0, 0), (0, 0, 0), COARSE)
    path = tmp_path / "picture.png"
    draw_answers(path, rover, holed, [LabelledAnswer("A", "here", answer)])
    assert path.stat().st_size > 10_000


def test_slopes_towards_the_sun_are_brighter():
    x = np.arange(30.0)[None, :] + np.zeros((30, 1))
    level = hill_shade(np.zeros((30, 30)), 0.1)
    rising_east = hill_shade(0.05 * x, 0.1)
    assert level == pytest.approx(2 / 3)
    # the sun is in the north-west: a slope that rises to the east faces it
    assert (rising_east > level).all()
    assert (hill_shade(0.05 * x.T, 0.1) < level).all()


def test_unknown_ground_has_no_shade(holed):
    shade = hill_shade(holed.elevation, holed.resolution)
    assert np.isnan(shade[70, 100])
    assert np.isfinite(shade[:50]).all()


def test_nothing_to_draw_and_nowhere_to_write_are_refused(tmp_path, rover, holed):
    with pytest.raises(PlanningError, match="no answers"):
        draw_answers(tmp_path / "picture.png", rover, holed, [])
    answers = [ask(rover, holed, "A", (0, 0, 0))]
    with pytest.raises(PlanningError, match="cannot write"):
        draw_answers(tmp_path / "no" / "picture.png", rover, holed, answers)
    with pytest.raises(PlanningError, match="cannot write"):
        draw_answers(tmp_path / "picture.tiger", rover, holed, answers)


def test_labelled_answers_are_frozen(rover, holed):
    labelled = ask(rover, holed, "A", (0, 0, 0))
    with pytest.raises(dataclasses.FrozenInstanceError):
        labelled.name = "B"
