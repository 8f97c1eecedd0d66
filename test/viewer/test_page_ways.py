"""The page in a real browser: a click beyond a wall shows the way around it."""

from collections.abc import Iterator

import numpy as np
import pytest

from rover_planner.viewer.pages.page import Page
from support.grounds import wall_with_gap
from support.viewer.browser import Visitor, needs_browser, wait_until
from support.viewer.sessions import walled_session
from support.viewer.visits import look_down_at, open_browser

pytestmark = [needs_browser, pytest.mark.slow]

BEYOND = np.array([1.6, 0.0])
"""A place on the other side of the wall [m]."""


@pytest.fixture
def page() -> Iterator[Page]:
    served = Page(walled_session(wall_with_gap), port=0)
    yield served
    served.close()


@pytest.fixture
def visitor(page) -> Iterator[Visitor]:
    with open_browser() as chromium:
        yield Visitor(chromium, page.url)


def test_a_click_beyond_a_wall_shows_the_way_around_it_and_what_was_searched(page, visitor):
    session = page.session
    visitor.wait_for("paused")
    look_down_at(page, visitor, np.array([*BEYOND, 0.0]))
    visitor.wait_for_ground()
    box = visitor.tab.locator("canvas").first.bounding_box()
    middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    visitor.click_scene(*middle)
    visitor.wait_for("way of ")
    np.testing.assert_allclose(session.goal[:2], BEYOND, atol=0.2)
    wait_until(lambda: visitor.text("#verdict:visible").startswith("traversable"), "the verdict")
    assert "none of 5 candidate paths passable" in visitor.text("#details:visible")
    poses = session.shown.candidate.poses
    assert np.all(poses[np.abs(poses[:, 0]) < 0.2, 1] > 1.0)  # through the gap

    visitor.open_tab("Ground and path")
    visitor.tab.locator("#judging").wait_for(state="hidden")
    wait_until(lambda: not page.is_busy, "all policies")
    before = visitor.steady_picture()
    visitor.tab.get_by_label("What was searched").check()
    wait_until(lambda: visitor.picture() != before, "what was searched")
    assert visitor.page_errors == [] and not page.errors.messages
