# SPDX-License-Identifier: Apache-2.0
"""The page advises on the path that is looked at, and judges it with a remedy that is taken."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("viser", reason="no viser: pip install '.[view]'")

from rover_physics.rover.rover_file import load_rover
from rover_planner.advice.advise import grow_advice
from rover_planner.advice.case import Case
from rover_planner.planning.path_query import PathQueryOptions
from rover_planner.viewer.pages.page import Page
from rover_planner.viewer.state.path_advice import apply_remedy
from rover_planner.viewer.state.session import ViewSession
from support.grounds import make_terrain
from support.viewer.sessions import wait_for_rest
from support.waiting import wait_until

LSR1 = load_rover("lsr1")
ENDS = (-1.5, 0.0, 0.0), (1.5, 0.0, 0.0)
OPTIONS = PathQueryOptions(count=1, waypoint_spacing=0.05)


def rock(x, y):
    """Return level ground with a rock below the left wheels of a rover on the x axis."""
    return 0.3 * np.exp(-((x - 0.2) ** 2 + (y - 0.2) ** 2) / 0.02)


def slope(x, y):
    return 0.3 * x


@pytest.mark.parametrize(
    ("ground", "changes", "levers"),
    [(slope, {"friction": 0.45}, {"policy", "friction"}), (rock, {}, {"shift", "curve"})],
)
def test_a_path_passes_with_the_values_that_a_remedy_has(ground, changes, levers):
    rover = replace(LSR1, **changes)
    session = ViewSession(rover, make_terrain(ground), *ENDS, OPTIONS)
    path, wanted = session.shown.path, session.wanted
    assert not path.verdict.traversable
    model = wanted.asked_options.model
    advice = next(
        one
        for one in grow_advice(Case(rover, wanted.terrain, path.poses, model))
        if {remedy.levers[0].lever.name for remedy in one.found} >= levers
    )
    for remedy in advice.remedies:
        session.take_change(apply_remedy(wanted, remedy))
        assert session.shown.verdict.traversable, remedy.describe()
        session.undo()
        assert not session.shown.verdict.traversable


@pytest.fixture
def page():
    served = Page(ViewSession(LSR1, make_terrain(rock), *ENDS, OPTIONS), port=0)
    wait_for_rest(served)
    yield served
    served.close()


def test_advice_is_sought_when_it_is_asked_for_shown_as_a_ghost_and_taken(page):
    assert page.channel.parts["advice"]["asked"] is False
    page.hear({"ask": "advise"}, None)

    def rows():
        return [row for row in page.channel.parts["advice"]["rows"] if row["index"] is not None]

    wait_until(lambda: rows() and not page.channel.parts["advice"]["busy"], "remedies", 60.0)
    place = next(row["index"] for row in rows() if row["words"].startswith("Drive "))
    page.hear({"ask": "ghost", "index": place}, None)
    wait_until(lambda: page.scene.paths._ghost.strands, "the ghost")
    page.hear({"ask": "remedy", "index": place}, None)
    wait_until(lambda: page.channel.parts["verdict"]["passes"], "the verdict with the remedy")
    assert not page.scene.paths._ghost.strands
    assert page.errors.messages == {}
