"""A map at the coordinates of a UTM zone in a real browser: sharp, and clicks land where aimed."""

from collections.abc import Iterator
from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from rover_planner.viewer.pages.page import Page
from rover_planner.viewer.state.session import ViewSession
from support.grounds import make_terrain, waves
from support.viewer.browser import Visitor, needs_browser, wait_until
from support.viewer.sessions import LSR1
from support.viewer.visits import FAR, look_down_at, open_browser, shift, visit, wait_for_rest

pytestmark = [needs_browser, pytest.mark.slow]

NEAR = (0.0, 0.0)


def serve(by: tuple[float, float]) -> Page:
    x, y = by
    ground = shift(make_terrain(waves), by)
    return Page(ViewSession(LSR1, ground, (x - 2.0, y, 0.0), (x + 1.0, y, 0.0)), port=0)


def picture_of(page: Page, visitor: Visitor, by: tuple[float, float]) -> np.ndarray:
    """Return the pixels of the scene from above, the same place of the ground for any map."""
    wait_for_rest(page)
    visitor.wait_for("paused")
    hidden = ".over-scene, .mantine-Notifications-root { display: none !important; }"
    visitor.tab.add_style_tag(content=hidden)
    look_down_at(page, visitor, np.array([by[0] - 1.0, by[1], 0.0]))
    visitor.wait_for_ground()
    picture = visitor.steady_picture()
    return np.asarray(Image.open(BytesIO(picture)).convert("RGB"), dtype=float)


@pytest.fixture(scope="module")
def browser() -> Iterator[object]:
    with open_browser() as chromium:
        yield chromium


def test_a_far_map_looks_like_a_near_one_and_a_click_lands_where_it_is_aimed(browser):
    page = serve(NEAR)
    with visit(page, browser) as visitor:
        near = picture_of(page, visitor, NEAR)
        place = np.array(page.scene._visual._root.position)
    page = serve(FAR)
    with visit(page, browser) as visitor:
        far = picture_of(page, visitor, FAR)
        differing = (np.abs(near - far).max(axis=2) > 60.0).mean()
        assert differing < 0.01  # with 32-bit coordinates it is a fifth of the picture

        start = page.session.shown.trajectory.state_at(0.0)
        assert start is not None
        np.testing.assert_allclose(start.position[:2], [FAR[0] - 2.0, FAR[1]], atol=1e-6)
        np.testing.assert_allclose(page.scene._visual._root.position, place, atol=1e-6)

        aim = np.array([FAR[0] + 1.5, FAR[1] + 0.5])
        height = float(page.session.terrain.elevation_at(*aim))
        look_down_at(page, visitor, np.array([*aim, height]), 3.0)
        box = visitor.tab.locator("canvas").first.bounding_box()
        visitor.click_scene(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        wait_until(lambda: page.session.goal[0] != FAR[0] + 1.0, "another goal")
        np.testing.assert_allclose(page.session.goal[:2], aim, atol=0.05)
        wait_for_rest(page)
        poses = page.session.shown.candidate.poses
        np.testing.assert_allclose(poses[-1, :2], aim, atol=0.05)
        assert not page.errors.messages and visitor.page_errors == []
