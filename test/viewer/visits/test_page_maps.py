# SPDX-License-Identifier: Apache-2.0
"""Pages of other maps in a real browser: at the coordinates of a UTM zone, and with a survey."""

from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from rover_physics.terrain.grid import Terrain
from rover_planner.viewer.pages.page import Page
from rover_planner.viewer.state.session import ViewSession
from support.grounds import make_terrain, waves
from support.viewer.browser import Visitor, needs_browser, wait_until
from support.viewer.sessions import FAR, LSR1, shift, wait_for_rest
from support.viewer.visits import look_down_at, visit

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
    visitor.hide_notices()
    visitor.tab.add_style_tag(content=".over-scene { display: none !important; }")
    look_down_at(page, visitor, np.array([by[0] - 1.0, by[1], 0.0]))
    visitor.wait_for_ground()
    picture = visitor.steady_picture()
    return np.asarray(Image.open(BytesIO(picture)).convert("RGB"), dtype=float)


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
        wait_until(lambda: page.session.scenario.goal[0] != FAR[0] + 1.0, "another goal")
        np.testing.assert_allclose(page.session.scenario.goal[:2], aim, atol=0.05)
        wait_for_rest(page)
        poses = page.session.shown.candidate.poses
        np.testing.assert_allclose(poses[-1, :2], aim, atol=0.05)
        assert not page.errors.messages and visitor.page_errors == []


def test_a_survey_is_shown_and_said_to_be_of_another_policy(browser, tmp_path):
    pytest.importorskip("zarr", reason="install the extra survey")
    from rover_planner.survey.reach.reachable import find_reachable
    from rover_planner.viewer.state.survey_layers import REACHABLE, load_map, open_survey
    from support.survey_maps import make_request, survey_here

    heights = np.zeros((60, 60))
    heights[:, 44:48] = 1.0
    store = survey_here(tmp_path, Terrain(heights, 0.1), make_request(headings=8)).store
    find_reachable(store, 1.5, 1.5)
    ground = load_map(store.path, 10_000)
    session = ViewSession(LSR1, ground, (1.5, 1.5, 0.0), (2.5, 1.5, 0.0))
    page = Page(session, port=0, survey=open_survey(store.path, LSR1, ground))
    with visit(page, browser) as visitor:
        visitor.open_tab("Ground and path")
        visitor.wait_for("impassable")
        wait_until(lambda: "survey: class" in visitor.text("#scale"), "the legend")
        before = visitor.picture()
        visitor.choose("Colour by", REACHABLE)
        visitor.wait_for("can go and return")
        wait_until(lambda: visitor.picture() != before, "other colours")
        visitor.shrink_scene()
        visitor.choose("Torques", "speed servos")
        visitor.wait_for("torque policy equal in the survey, servo here")
        visitor.choose("Colour by", "height")
        visitor.wait_for("a line every metre")
        assert not visitor.page_errors
