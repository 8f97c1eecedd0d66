"""A page with a browser for the tests of a module, and grounds far from the origin."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from rover_physics.terrain.grid import Terrain
from rover_planner.viewer.pages.page import Page
from support.viewer.browser import ARGUMENTS, PROGRAM, Visitor, sync_api, wait_until

FAR = (500_000.0, 4_000_000.0)
"""Place of a map in a UTM zone: easting and northing [m]."""


def shift(terrain: Terrain, by: tuple[float, float]) -> Terrain:
    """Return a ground at another place [m]."""
    return Terrain(
        terrain.elevation,
        terrain.resolution,
        (terrain.origin[0] + by[0], terrain.origin[1] + by[1]),
    )


@contextmanager
def open_browser() -> Iterator[object]:
    """Start a browser."""
    with sync_api.sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=PROGRAM, args=ARGUMENTS)
        yield chromium
        chromium.close()


@contextmanager
def visit(page: Page, browser: object, query: str = "") -> Iterator[Visitor]:
    """Serve a page to a visitor, and close both."""
    try:
        visitor = Visitor(browser, page.url + query)
        yield visitor
        visitor.tab.close()
    finally:
        page.close()


def wait_for_rest(page: Page) -> None:
    """Wait until everything that is wanted is judged and shown."""
    session = page.session

    def at_rest() -> bool:
        done = session.finished.answered is session.finished.scenario is session.wanted
        return done and not page.is_busy and page._changed_at is None

    wait_until(lambda: at_rest() or session.refusal, "all judgements")


def look_down_at(page: Page, place: np.ndarray, height: float = 6.0) -> None:
    """Let the visitors' cameras look at a place (3,) [m], map frame, from above."""
    frame = page.scene.frame
    for client in page.server.get_clients().values():
        client.camera.position = frame.to_scene(place) + np.array([-0.001, 0.0, height])
        client.camera.look_at = frame.to_scene(place)
