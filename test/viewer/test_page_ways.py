"""The page in a real browser: a click beyond a wall shows the way around it."""

from collections.abc import Iterator

import numpy as np
import pytest

from rover_planner.viewer.pages.page import Page
from support.grounds import wall_with_gap
from support.viewer.browser import ARGUMENTS, PROGRAM, Visitor, needs_browser, sync_api, wait_until
from support.viewer.sessions import walled_session

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
    with sync_api.sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=PROGRAM, args=ARGUMENTS)
        yield Visitor(chromium, page.url)
        chromium.close()


def look_down_at(page: Page, place: np.ndarray) -> None:
    """Let the visitor's camera look at a place (2,) [m] from above."""
    (client,) = page.server.get_clients().values()
    client.camera.position = (place[0] - 0.5, place[1], 6.0)
    client.camera.look_at = (*place, 0.0)


def test_a_click_beyond_a_wall_shows_the_way_around_it_and_what_was_searched(page, visitor):
    session = page.session
    visitor.wait_for("paused")
    before = visitor.picture()
    look_down_at(page, BEYOND)
    wait_until(lambda: visitor.picture() != before, "the other view")
    box = visitor.tab.locator("canvas").first.bounding_box()
    middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    visitor.click_scene(*middle)
    visitor.wait_for("way of ")
    np.testing.assert_allclose(session.goal[:2], BEYOND, atol=0.2)
    assert visitor.text("#verdict:visible").startswith("traversable")
    assert "none of 5 candidate paths passable" in visitor.text("#details:visible")
    poses = session.shown.candidate.poses
    assert np.all(poses[np.abs(poses[:, 0]) < 0.2, 1] > 1.0)  # through the gap

    visitor.open_tab("Ground and path")
    visitor.tab.locator("#judging").wait_for(state="hidden")
    wait_until(lambda: not page.is_busy, "all policies")
    before = visitor.picture()
    visitor.tab.get_by_label("What was searched").check()
    wait_until(lambda: visitor.picture() != before, "what was searched")
    assert visitor.page_errors == [] and not page.errors.messages
