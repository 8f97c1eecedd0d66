"""Windows of several sizes in a real browser: what matters is seen without scrolling."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from rover_planner.planning.path_query import PathQueryOptions
from rover_planner.planning.ways.way_search import LatticeSettings
from rover_planner.viewer.pages.page import Page
from rover_planner.viewer.state.session import ViewSession
from support.grounds import make_terrain
from support.viewer.browser import LAPTOP, Visitor, needs_browser, wait_until
from support.viewer.sessions import LSR1, ramp
from support.viewer.visits import look_from, open_browser, visit, wait_for_rest

pytestmark = [needs_browser, pytest.mark.slow]

IN_SIGHT = """e => {
    const {left, right, top, bottom} = e.getBoundingClientRect();
    const seen = (x, y) => {
        const at = document.elementFromPoint(x, y);
        return at !== null && (e.contains(at) || at.contains(e));
    };
    return [top + 4, bottom - 4].every((y) => seen((left + right) / 2, y));
}"""
"""Returns whether the upper and the lower edge of an element are on the screen, not hidden."""

HIDDEN = """() => {
    const covers = [...document.querySelectorAll('#header, #hint')].map(
        e => e.getBoundingClientRect()).filter(e => e.width > 0);
    const boxes = [...document.querySelectorAll('.label-box')].filter(e => e.offsetParent);
    return [boxes.length, boxes.filter(box => {
        const p = box.getBoundingClientRect();
        return p.bottom < 0 || covers.some(q => p.left < q.right && q.left < p.right
            && p.top < q.bottom && q.top < p.bottom);
    }).map(box => box.textContent)];
}"""
"""How many labels there are, and which are behind the header or the hint, or above the window."""


@pytest.fixture(scope="module")
def page() -> Page:
    """A page with a refused path, whose notice needs the most room."""
    options, search = PathQueryOptions(count=3, spacing=0.5), LatticeSettings(budget=0.1)
    slippery = replace(LSR1, friction=0.4)
    ends = (-2.0, 0.0, 0.0), (1.0, 0.0, 0.0)
    return Page(ViewSession(slippery, make_terrain(ramp), *ends, options, search), port=0)


@pytest.fixture(scope="module")
def visitor(page) -> Iterator[Visitor]:
    """A visitor of the page at rest."""
    with open_browser() as browser, visit(page, browser) as opened:
        opened.tab.add_style_tag(content=".mantine-Notifications-root { display: none; }")
        wait_for_rest(page)
        opened.wait_for("Go to the failure")
        yield opened


@pytest.mark.parametrize("size", [(900, 700), (1280, 720), (1600, 1000), (700, 700)])
def test_header_board_and_lanes_are_seen_beside_a_wide_scene(visitor, size):
    width, height = size
    visitor.tab.set_viewport_size({"width": width, "height": height})
    canvas = visitor.tab.locator("canvas").first
    is_narrow = width < 1000
    wait_until(lambda: (canvas.bounding_box()["x"] < 20.0) == is_narrow, "the panels")
    wait_until(lambda: canvas.bounding_box()["width"] > 0.4 * width, "a wide scene")
    for name in ("#board", "#lanes"):
        part = visitor.tab.locator(name)
        wait_until(lambda part=part: part.evaluate(IN_SIGHT), f"all of {name}")
    header = visitor.tab.locator("#header")

    def is_inside() -> bool:
        box = header.bounding_box()
        return box["x"] >= 0.0 and box["x"] + box["width"] <= width

    wait_until(is_inside, "all of the header")


def test_a_window_that_grows_wide_has_its_panels_side_by_side_again(visitor):
    canvas = visitor.tab.locator("canvas").first
    visitor.tab.set_viewport_size({"width": 900, "height": 700})
    wait_until(lambda: canvas.bounding_box()["x"] < 20.0, "the panels to float")
    visitor.tab.set_viewport_size(LAPTOP)
    wait_until(lambda: canvas.bounding_box()["x"] >= 250.0, "the panels side by side")


@pytest.mark.parametrize("down", [0.9, 1.2])
def test_no_label_stands_behind_the_header(page, visitor, down):
    visitor.tab.set_viewport_size(LAPTOP)
    failure = page.scene.frame.to_scene(page.judged.path.why.failure.state.position)
    place = np.add(failure, [-2.5, 0.3, 0.6])  # the failure is at the upper edge
    look_from(page, visitor, place, failure - [0.0, 0.0, down])
    wait_until(lambda: visitor.tab.evaluate(HIDDEN)[0] >= 3, "the labels")
    wait_until(lambda: visitor.tab.evaluate(HIDDEN)[1] == [], "labels beside the header")
