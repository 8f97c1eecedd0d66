# SPDX-License-Identifier: Apache-2.0
"""Pictures of answers are drawn for accepted and refused paths, on maps with and without holes."""

import numpy as np
import pytest

pytest.importorskip("matplotlib", reason="needs matplotlib")
from matplotlib.figure import Figure

from rover_planner.demo.answers_picture import draw_answers
from rover_planner.demo.goals import Goal
from rover_planner.figures.path_pictures import _draw_uses, draw_path
from rover_planner.planning.path_query import PathQueryOptions
from rover_planner.planning.search.judge import PathJudge
from rover_planner.planning.search.path_search import find_path
from rover_planner.planning.search.query import LatticeSettings, SearchQuery, Site
from support.grounds import make_terrain
from support.paths import poses_at
from support.rovers import LSR1


def test_a_picture_shows_accepted_and_refused_answers_each_with_its_curves(tmp_path):
    holed = make_terrain(lambda x, y: np.where((x > 2.0) & (y > 2.0), np.nan, 0.0), 0.1, 6.0)
    goals = {"A": (0, 0, 0), "B": (4, 3, 0.5), "C": (9, 0, 0)}
    options = PathQueryOptions(count=3, spacing=0.4, waypoint_spacing=0.1)
    judge = PathJudge(Site(LSR1, holed, options))
    answers = [
        (Goal(name, "plain", goal), judge.search((-4, 0, 0), goal)) for name, goal in goals.items()
    ]
    assert [answer.traversable for _, answer in answers] == [True, False, False]
    path = tmp_path / "picture.svg"
    draw_answers(path, LSR1, holed, answers, "title")
    text = path.read_text()
    titles = ("A (plain):", "chosen path, 4.0 m", "B (plain):", "C (plain):", "refused, off map")
    assert [title for title in titles if title not in text] == []


def test_the_picture_of_a_plan_names_rover_and_map_and_shows_the_use_of_each_limit(tmp_path):
    ground = make_terrain(lambda x, y: 0.0 * x, half=2.0)
    question = SearchQuery(Site(LSR1, ground), (-1.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    answer = find_path(question, LatticeSettings(budget=5.0, ends_at_first=True))
    draw_path(tmp_path / "plan.svg", question, answer, "hill.npz")
    text = (tmp_path / "plan.svg").read_text()
    words = ("lsr1 on hill.npz: path of 2.0 m", "use of the limit, 1 at it", "margin")
    assert [one for one in words if one not in text] == []


def test_the_use_along_a_plan_has_the_peaks_between_waypoints():
    bump = make_terrain(lambda x, y: 0.06 * ((x > 0.3) & (x < 0.5)))
    path = PathJudge(Site(LSR1, bump)).check(poses_at(np.linspace(-1.0, 1.0, 41)))
    axes = Figure().subplots()
    _draw_uses(axes, LSR1, path)
    highest = max(np.nanmax(line.get_ydata()) for line in axes.lines[:-1])
    assert highest >= path.verdict.risk > path.prediction.friction_utilisation.max()


def test_forces_that_no_verdict_asks_for_are_shaded(tmp_path, monkeypatch):
    """A wheel that rolls off an edge may use more friction than the verdict tells."""
    drawn = []
    monkeypatch.setattr(Figure, "savefig", lambda self, *_, **__: drawn.append(self))
    ledge = make_terrain(lambda x, y: 0.06 * (x < -2.5), half=4.5)
    judge = PathJudge(Site(LSR1, ledge, PathQueryOptions(count=1)))
    for goal, is_beyond in (((-3.2, 0, 0), False), ((-1.5, 0, 0), True)):
        answer = judge.search((-3.5, 0, 0), goal)
        falls = answer.chosen.prediction.falling.any(axis=1)
        assert (0 < falls.sum() < len(falls)) == is_beyond
        asked = Goal("A", "plain", goal)
        draw_answers(tmp_path / "picture.png", LSR1, ledge, [(asked, answer)], "title")
        curves = [axes for axes in drawn[-1].axes if axes.get_xlabel() != "x [m]"]
        shaded = {axes.get_ylabel().split("\n")[0]: len(axes.patches) for axes in curves}
        for name in ("wheel load [N]", "friction", "torque"):
            assert shaded[name] >= falls.sum()
        assert any(shaded.values()) == is_beyond and shaded["tip-over margin"] == 0
