# SPDX-License-Identifier: Apache-2.0
"""A browser for the tests of a module, what it has heard of a page, and its camera."""

import itertools
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from rover_planner.viewer.browser.channel import run_script
from rover_planner.viewer.pages.page_base import PageBase
from support.viewer.browser import (
    ARGUMENTS,
    PROGRAM,
    WAIT,
    Visitor,
    sync_api,
    wait_until,
)

NUMBERS = itertools.count(1)

SEEN_FROM_CAMERA = """places => {
    const viser = window.__viserMutable, root = viser && viser.nodeRefFromName[''];
    if (!root || !viser.camera) return places.map(() => [NaN, NaN, NaN]);
    const times = (matrix, [x, y, z, w]) => [0, 1, 2, 3].map((row) =>
        matrix[row] * x + matrix[row + 4] * y + matrix[row + 8] * z + matrix[row + 12] * w);
    const view = [root.matrixWorld.elements, viser.camera.matrixWorldInverse.elements];
    return places.map((place) =>
        view.reduce((at, matrix) => times(matrix, at), [...place, 1]).slice(0, 3));
}"""
"""Returns places of the scene in the frame of the browser's camera, which looks along -z."""


@contextmanager
def open_browser() -> Iterator[object]:
    """Start a browser."""
    with sync_api.sync_playwright() as playwright:
        chromium = playwright.chromium.launch(
            executable_path=PROGRAM, args=ARGUMENTS, timeout=1000.0 * WAIT
        )
        yield chromium
        chromium.close()


@contextmanager
def visit(page: PageBase, browser: object, *, sees_scene: bool = True) -> Iterator[Visitor]:
    """Serve a page to a visitor, and close both."""
    try:
        visitor = Visitor(browser, page.url, sees_scene=sees_scene)
        yield visitor
        visitor.tab.close()
    finally:
        page.close()


def wait_for_browser(page: PageBase, visitor: Visitor) -> None:
    """Wait until the visitor's browser shows all that the page has sent so far.

    The page is at rest before its visitors have seen it.
    """
    number = next(NUMBERS)
    run_script(page.server, f"window.heardFromTest = {number};")
    visitor.tab.wait_for_function(
        "number => window.heardFromTest === number && new Promise((tell) =>"
        "requestAnimationFrame(() => requestAnimationFrame(() => tell(true))))",
        arg=number,
    )


def find_camera(page: PageBase) -> Any:
    """Return the camera of the page's newest visitor, once nothing else moves it.

    The page aims it when the visitor comes, which is later than the visitor sees the board.
    """

    def welcomed() -> list[Any]:
        clients = page.server.get_clients()
        newest = max(clients, default=None)
        return [clients[newest]] if newest in page._visitors.greeted else []

    return wait_until(welcomed, "the visitor to be welcomed")[0].camera


def look_from(page: PageBase, visitor: Visitor, position: Any, look_at: Any) -> None:
    """Let the visitor's camera look from one place (3,) of the scene at another [m].

    It returns when the browser does so.
    """
    camera, places = find_camera(page), np.array([position, look_at], dtype=float)
    camera.position, camera.look_at = places
    ahead = float(np.linalg.norm(places[1] - places[0]))

    def looks() -> bool:
        seen = np.array(visitor.tab.evaluate(SEEN_FROM_CAMERA, places.tolist()), dtype=float)
        return np.allclose(seen, [[0.0, 0.0, 0.0], [0.0, 0.0, -ahead]], atol=0.002 * ahead)

    wait_until(looks, "the browser's camera")


def look_down_at(page: PageBase, visitor: Visitor, place: np.ndarray, height: float = 6.0) -> None:
    """Let the visitor's camera look at a place (3,) [m], map frame, from above."""
    at = page.scene.frame.to_scene(place)
    look_from(page, visitor, at + np.array([-0.001, 0.0, height]), at)
