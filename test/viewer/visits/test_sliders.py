"""Sliders dragged to both ends on three maps in a real browser: the page lives and is right.

With PAGE_SLIDERS=all in the environment every slider is dragged, else FEW for each map. Without
ROVER_LONG_TESTS only the far map is shown.
"""

import os
from collections.abc import Iterator

import numpy as np
import pytest

from rover_physics.terrain.grid import Terrain, load_terrain
from rover_physics.traversability.judge_path import judge_path
from rover_planner.command.view import choose_ends
from rover_planner.planning.path_query import PathQueryOptions
from rover_planner.planning.ways.way_search import LatticeSettings
from rover_planner.studies.rover_values import RoverValue, list_values
from rover_planner.viewer.pages.page import Page
from rover_planner.viewer.state.session import ViewSession
from rover_planner.worlds.mars_terrain import make_mars_terrain
from support.project.long_tests import on_demand
from support.viewer.browser import Visitor, needs_browser, wait_until
from support.viewer.sessions import LSR1
from support.viewer.visits import FAR, open_browser, shift, visit, wait_for_rest

pytestmark = [needs_browser, pytest.mark.slow]

LENGTH = 3.0
"""Longest distance from start to goal [m]."""
FEW = {
    "made": ("friction [-]",),
    "spirit": ("body centre z [m]",),
    "far": ("front wheel x [m]",),
}
"""Sliders by map; their ends make paths impassable, or rovers impossible."""


def load_ground(name: str) -> Terrain:
    if name == "spirit":
        return load_terrain("spirit").fill_gaps(0.2)
    ground = make_mars_terrain(7, 8.0, 0.05)
    return shift(ground, FAR) if name == "far" else ground


@pytest.fixture(scope="module")
def browser() -> Iterator[object]:
    with open_browser() as chromium:
        yield chromium


def serve(name: str) -> Page:
    ground = load_ground(name)
    start, goal = choose_ends(LSR1, ground)
    ahead = np.subtract(goal[:2], start[:2])
    ahead *= min(1.0, LENGTH / float(np.linalg.norm(ahead)))
    goal = (float(start[0] + ahead[0]), float(start[1] + ahead[1]), goal[2])
    options, search = PathQueryOptions(count=2, spacing=0.5), LatticeSettings(budget=0.1)
    return Page(ViewSession(LSR1, ground, start, goal, options, search), port=0)


def check_page(page: Page, visitor: Visitor) -> None:
    """Compare what the page shows with what the library says of the same path."""
    session = page.session
    poses, options = session.shown.candidate.poses, session.sweep_options()
    _, verdict = judge_path(session.rover, session.terrain, poses, options)
    assert session.shown.verdict.traversable == verdict.traversable
    assert session.shown.verdict.reason == verdict.reason
    word = "traversable" if verdict.traversable else "not traversable"
    chip = visitor.tab.locator('[data-chip="is"]')
    wait_until(lambda: chip.inner_text() == word, "the verdict in the header")
    assert verdict.reason in visitor.text("#verdict:visible")
    assert not page.errors.messages and visitor.page_errors == []


def show_slider(visitor: Visitor, folder: str, label: str) -> None:
    """Open the folder of a slider."""
    if not visitor.tab.get_by_text(label, exact=True).is_visible():
        visitor.tab.get_by_text(folder, exact=True).click()
        visitor.tab.get_by_text(label, exact=True).wait_for(state="visible")


def drag_to_both_ends(page: Page, visitor: Visitor, value: RoverValue) -> None:
    """Drag a slider to both ends, and type its first value again."""
    session, label, handle = page.session, value.label, page.rover_tab._sliders._sliders[value]
    first = handle.value
    for share, end in ((1.0, value.high), (0.0, value.low)):
        if handle.value == pytest.approx(end):
            continue
        before = session.wanted
        visitor.drag_slider(label, share)
        wait_until(lambda before=before: session.wanted is not before, f"{label} at {share}")
        wait_for_rest(page)
        check_page(page, visitor)
    if handle.value != pytest.approx(first):
        before = session.wanted
        visitor.set_slider(label, repr(first))
        wait_until(lambda: session.wanted is not before, f"the first value of {label}")
        wait_for_rest(page)
    assert visitor.slider_value(label) == pytest.approx(first)


@pytest.mark.parametrize(
    "name", [name if name == "far" else pytest.param(name, marks=on_demand) for name in FEW]
)
def test_sliders_at_both_ends_leave_the_page_alive_and_right(name, browser):
    page = serve(name)
    with visit(page, browser) as visitor:
        visitor.shrink_scene()
        wait_for_rest(page)
        visitor.open_tab("Rover")
        for folder, values in list_values(LSR1).items():
            for value in values:
                if os.environ.get("PAGE_SLIDERS") == "all" or value.label in FEW[name]:
                    show_slider(visitor, folder, value.label)
                    drag_to_both_ends(page, visitor, value)
        check_page(page, visitor)
        assert page.session.rover == LSR1
        visitor.open_tab("Drive")
        visitor.press("Play")
        wait_until(lambda: page.playback.time > 0.0, "the rover to drive")
