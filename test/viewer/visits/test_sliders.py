# SPDX-License-Identifier: Apache-2.0
"""Sliders dragged to both ends on real pages in a real browser: it lives and is right."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from rover_physics.rover.rover_file import rover_to_dict
from rover_physics.terrain.grid import Terrain, load_terrain
from rover_physics.traversability.judge import judge_path
from rover_planner.command.view import choose_ends
from rover_planner.planning.path_query import PathQueryOptions
from rover_planner.planning.search.query import LatticeSettings
from rover_planner.studies.rover_values import get_value
from rover_planner.viewer.pages.page import Page
from rover_planner.viewer.state.session import ViewSession
from rover_planner.worlds.mars_terrain import make_mars_terrain
from support.viewer.browser import Visitor, needs_browser, wait_until
from support.viewer.sessions import FAR, LSR1, shift, wait_for_rest

pytestmark = [needs_browser, pytest.mark.slow, pytest.mark.long]

LENGTH = 3.0
"""Longest distance from start to goal [m]."""
BEYOND = 0.05
"""Distance of the mouse beyond the end at last, as a share of the slider's length."""
GROUNDS: dict[str, Callable[[], Terrain]] = {
    "made": lambda: make_mars_terrain(7, 8.0, 0.05),
    "spirit": lambda: load_terrain("spirit").fill_gaps(0.2),
    "far": lambda: shift(make_mars_terrain(7, 8.0, 0.05), FAR),
}


def serve(ground: Terrain) -> Page:
    start, goal = choose_ends(LSR1, ground)
    ahead = np.subtract(goal[:2], start[:2])
    ahead *= min(1.0, LENGTH / float(np.linalg.norm(ahead)))
    goal = (float(start[0] + ahead[0]), float(start[1] + ahead[1]), goal[2])
    options, search = PathQueryOptions(count=2, spacing=0.5), LatticeSettings(budget=0.1)
    return Page(ViewSession(LSR1, ground, start, goal, options, search), port=0)


def list_sliders(page: Page) -> list[tuple[Any, Callable[[], float]]]:
    """Return all sliders of the rover and its arm, and what returns the value that is wanted."""
    wanted, tab, arm = lambda: page.session.wanted, page.rover_tab, LSR1.manipulator
    numbers = [
        (slider, lambda key=value.keys[0]: get_value(rover_to_dict(wanted().rover), key))
        for value, slider in tab.sliders.items()
    ]
    stowed = dict(zip(arm.joints, arm.stowed, strict=True))
    return numbers + [
        (slider, lambda joint=joint: wanted().arm_angles.get(joint, stowed[joint]))
        for joint, slider in tab.arm.items()
    ]


def check_page(page: Page, visitor: Visitor) -> None:
    """Compare what the page shows with what the library says of the same path."""
    session, chip = page.session, visitor.tab.locator('[data-chip="is"]')

    def is_seen() -> bool:
        verdict = session.shown.verdict
        word = "traversable" if verdict.traversable else "not traversable"
        return chip.inner_text() == word and verdict.reason in visitor.text("#verdict:visible")

    wait_until(is_seen, "the verdict in header and tab")
    now = session.shown
    options, poses = now.scenario.asked_options.model, now.candidate.poses
    _, verdict = judge_path(now.scenario.rover, now.scenario.terrain, poses, options)
    assert now.verdict.traversable == verdict.traversable
    assert now.verdict.reason == verdict.reason
    assert not page.errors.messages and visitor.page_errors == []


@pytest.mark.parametrize("name", GROUNDS)
def test_sliders_at_both_ends_leave_the_page_alive_and_right(name, browser):
    page = serve(GROUNDS[name]())
    try:
        visitor = Visitor(browser, page.url)
        wait_for_rest(page)
        visitor.open_tab("Rover")
        for folder in ("Wheels", "Masses", "Arm"):  # closed at first
            visitor.tab.get_by_text(folder, exact=True).click()
        for slider, wanted in list_sliders(page):
            for share in (1.0 + BEYOND, -BEYOND):
                visitor.drag_slider(slider.label.removeprefix("\u25cf "), share)
                wait_for_rest(page)
                is_shown = lambda: slider.value == pytest.approx(wanted())  # noqa: B023, E731
                wait_until(is_shown, f"the value of {slider.label} that is judged")
                check_page(page, visitor)
            visitor.press("Reset")
            wait_until(lambda: page.session.wanted.rover == LSR1, "the loaded rover")
            wait_for_rest(page)
        check_page(page, visitor)
        assert page.session.rover == LSR1 and not page.session.scenario.arm_angles
        visitor.open_tab("Drive")
        visitor.press("Play")
        wait_until(lambda: page.playback.time > 0.0, "the rover to drive")
        visitor.tab.close()
    finally:
        page.close()
