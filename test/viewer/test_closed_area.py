# SPDX-License-Identifier: Apache-2.0
"""The closed area on the ground of a real page, without a browser."""

from collections.abc import Iterator

import numpy as np
import pytest

from support.grounds import gap, make_terrain, wall_with_gap, whole_wall
from support.viewer.sessions import walled_session
from support.waiting import wait_until

pytest.importorskip("viser", reason="no viser: pip install '.[view]'")


from rover_planner.planning.search.nodes import nodes_within
from rover_planner.viewer.pages.page import Page
from rover_planner.viewer.scene.closed_area import cover_places
from rover_planner.viewer.state.colours import PASSABLE, REFUSED, UNKNOWN

BEYOND = np.array([1.6, 0.0])
"""A place on the other side of the wall [m]."""
PATIENCE = 60.0
"""Longest wait for a search [s]."""


def test_a_layer_covers_the_known_ground_of_its_places_and_nothing_else():
    ground = make_terrain(gap)
    nodes = nodes_within(0.2, (-4.0, -4.0), (4.0, 4.0))
    places = np.zeros(nodes.shape, bool)
    places[10:21, 20:31] = True  # x 0 to 2 m, y -2 to 0 m, and half a cell around
    vertices, faces = cover_places(ground, nodes, places)
    x, y, z = vertices.T
    assert len(faces) and set(np.unique(faces)) == set(range(len(vertices)))
    np.testing.assert_allclose([x.min(), x.max()], [-0.1, 2.1], atol=0.051)
    np.testing.assert_allclose([y.min(), y.max()], [-2.1, 0.1], atol=0.051)
    assert not np.any((x > 0.51) & (x < 0.99))  # unknown ground
    column, row = np.rint((vertices[:, :2] - ground.origin) / ground.resolution).astype(int).T
    np.testing.assert_array_equal(z, ground.elevation[row, column])
    unknown = np.zeros(nodes.shape, bool)
    unknown[:, 24] = True  # x = 0.8 m
    assert not len(cover_places(ground, nodes, unknown)[1])


@pytest.fixture(params=[wall_with_gap, whole_wall])
def page(request) -> Iterator[Page]:
    served = Page(walled_session(request.param), port=0)
    wait_until(lambda: not served.is_busy, "the ground", PATIENCE)
    yield served
    served.close()


def count_rows(page: Page) -> int:
    """Return how many paths the table of candidates has."""
    return page.candidates.content.count("<tbody data-say=")


def test_a_click_beyond_a_wall_shows_the_way_or_the_closed_area_on_the_page(page):
    session = page.session
    page.requests.add(lambda: page.click(BEYOND, False))
    wait_until(lambda: session.shown.around is not None and not page.is_busy, "a way", PATIENCE)
    area = page.scene.closed
    closes = session.shown.around.closed is not None
    wait_until(lambda: (area.layer is not None) == closes, "the layer")
    if closes:
        colour = REFUSED if session.shown.around.closed.around_goal else PASSABLE
        for is_old, wanted in ((True, UNKNOWN), (False, colour)):
            area.mark_old(is_old)
            assert tuple(area.layer.color) == wanted
    text = page.drive_tab._verdict.content + page.drive_tab._below.content
    if closes:
        assert "no way within the map" in text and count_rows(page) == 5
    else:
        wait_until(lambda: count_rows(page) == 6, "the list of paths")
        assert "passable, best" in page.candidates.content
        assert page.playback.duration == session.shown.trajectory.duration
    page.requests.add(lambda: page.click(np.array([-1.1, 0.0]), False))
    wait_until(lambda: session.shown.around is None and area.layer is None, "no layer", PATIENCE)
    assert not page.errors.messages
