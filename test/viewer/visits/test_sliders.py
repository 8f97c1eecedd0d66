# SPDX-License-Identifier: Apache-2.0
"""Sliders dragged to both ends on real pages in a real browser: it lives and is right."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from rover_physics.rover.rover_contents import rover_to_dict
from rover_physics.terrain.grid import Terrain, load_terrain
from rover_physics.traversability.judge import judge_path
from rover_planner.command.view import choose_ends
from rover_planner.planning.path_query import PathQueryOptions
from rover_planner.planning.ways.way_search import LatticeSettings
from rover_planner.studies.rover_values import get_value, list_values
from rover_planner.viewer.pages.page import Page
from rover_planner.viewer.panel.controls import on_visitor_input
from rover_planner.viewer.state.scenario import Shown
from rover_planner.viewer.state.session import ViewSession
from rover_planner.worlds.mars_terrain import make_mars_terrain
from support.viewer.browser import Visitor, needs_browser, wait_until
from support.viewer.sessions import FAR, LSR1, shift, wait_for_rest
from support.viewer.visits import visit

pytestmark = [needs_browser, pytest.mark.slow]

LENGTH = 3.0
"""Longest distance from start to goal [m]."""
SMALL = {"width": 1000, "height": 560}
"""Size of the window [px]; a browser draws a small one faster, and scrolls to the sliders."""
MOVES = 2
"""Moves of the mouse from one end of a slider to the other; each is a value of its own."""
BEYOND = 0.05
"""Distance of the mouse beyond the end at last, as a share of the slider's length."""
TRIES, PATIENCE = 20, 5.0
"""How often something is tried until the page hears of it, and for how long after each [s]."""


@dataclass(frozen=True)
class Slider:
    """A slider of the tab of the rover."""

    folder: str
    """Folder in which it is."""
    label: str
    """Its label."""
    handle: Any
    """Its handle of viser."""
    wanted: Callable[[], float]
    """Returns the value that is judged, or will be."""


def load_ground(name: str) -> Terrain:
    if name == "spirit":
        return load_terrain("spirit").fill_gaps(0.2)
    ground = make_mars_terrain(7, 8.0, 0.05)
    return shift(ground, FAR) if name == "far" else ground


def serve(name: str) -> Page:
    ground = load_ground(name)
    start, goal = choose_ends(LSR1, ground)
    ahead = np.subtract(goal[:2], start[:2])
    ahead *= min(1.0, LENGTH / float(np.linalg.norm(ahead)))
    goal = (float(start[0] + ahead[0]), float(start[1] + ahead[1]), goal[2])
    options, search = PathQueryOptions(count=2, spacing=0.5), LatticeSettings(budget=0.1)
    return Page(ViewSession(LSR1, ground, start, goal, options, search), port=0)


def list_sliders(page: Page) -> list[Slider]:
    """Return the sliders of all numbers of the rover and of all joints of its arm."""
    session, tab = page.session, page.rover_tab
    assert tab._sliders is not None and LSR1.manipulator is not None
    handles, arm = tab._sliders._sliders, LSR1.manipulator
    stowed = dict(zip(arm.joints, arm.stowed, strict=True))
    numbers = [
        Slider(
            folder,
            value.label,
            handles[value],
            lambda key=value.keys[0]: get_value(rover_to_dict(session.wanted.rover), key),
        )
        for folder, values in list_values(LSR1).items()
        for value in values
    ]
    return numbers + [
        Slider(
            "Arm",
            handle.label,
            handle,
            lambda joint=joint: session.wanted.arm_angles.get(joint, stowed[joint]),
        )
        for joint, handle in tab._arm.items()
    ]


def is_judged(page: Page) -> bool:
    """Return whether the shown verdict is that of the newest values."""
    return not page.session.is_outdated and not page.session.has_news


def check_page(page: Page, visitor: Visitor) -> None:
    """Compare what the page shows with what the library says of the same path."""
    session = page.session
    chip = visitor.tab.locator('[data-chip="is"]')
    text = visitor.tab.locator("#verdict:visible")

    def find_shown() -> Shown | None:
        """Return the judgement that the browser shows; None on the way to another one."""
        now, verdict = session.shown, session.shown.verdict
        word = "traversable" if verdict.traversable else "not traversable"
        is_seen = chip.inner_text() == word and verdict.reason in text.inner_text()
        return now if is_seen and session.shown is now else None

    now = wait_until(find_shown, "the verdict in header and tab")
    options = now.scenario.asked_options.model
    poses = now.candidate.poses
    _, verdict = judge_path(now.scenario.rover, now.scenario.terrain, poses, options)
    assert now.verdict.traversable == verdict.traversable
    assert now.verdict.reason == verdict.reason
    assert not page.errors.messages and visitor.page_errors == []


def repeat_until(condition: Callable[[], bool], act: Callable[[], None], what: str) -> None:
    """Act with the mouse until the page has heard of it, for the mouse may miss its aim."""
    for _ in range(TRIES):
        act()
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            if condition():
                return
            time.sleep(0.01)
    raise AssertionError(f"tried {TRIES} times, and the page has not heard of {what}")


def drag_to_both_ends(page: Page, visitor: Visitor, slider: Slider) -> None:
    """Drag a slider to both ends, where the page must be right, and take the changes back.

    A value that makes no rover goes back to the last one that did.
    """
    handle, heard = slider.handle, []
    on_visitor_input(handle, heard.append)
    for share, end in ((1.0 + BEYOND, handle.max), (-BEYOND, handle.min)):
        if handle.value == pytest.approx(end):
            continue
        repeat_until(
            lambda end=end: heard[-1:] == [pytest.approx(end)],
            lambda share=share: visitor.drag_slider(slider.label, share, MOVES),
            f"{slider.label} at {end}",
        )
        wait_until(
            lambda: handle.value == pytest.approx(slider.wanted()) and is_judged(page),
            f"the verdict on {slider.label} at {end}",
        )
        check_page(page, visitor)
    session = page.session
    if session.wanted.rover != LSR1 or session.wanted.arm_angles:
        repeat_until(
            lambda: session.wanted.rover == LSR1 and not session.wanted.arm_angles,
            lambda: visitor.press("Reset"),
            f"the reset of {slider.label}",
        )
        wait_until(lambda: is_judged(page), f"the verdict after the reset of {slider.label}")


def first_of_each_folder(sliders: list[Slider]) -> list[Slider]:
    return list({slider.folder: slider for slider in reversed(sliders)}.values())


@pytest.mark.parametrize(
    ("name", "choose"),
    [("far", first_of_each_folder)]
    + [pytest.param(name, list, marks=pytest.mark.long) for name in ("made", "spirit", "far")],
)
def test_sliders_at_both_ends_leave_the_page_alive_and_right(name, choose, browser):
    page = serve(name)
    with visit(page, browser, sees_scene=False) as visitor:
        visitor.tab.set_viewport_size(SMALL)
        wait_for_rest(page)
        visitor.open_tab("Rover")
        for folder in ("Wheels", "Masses", "Arm"):  # closed at first
            visitor.tab.get_by_text(folder, exact=True).click()
        sliders = choose(list_sliders(page))
        assert {slider.folder for slider in sliders} > {"Wheels", "Masses", "Arm"}
        for slider in sliders:
            drag_to_both_ends(page, visitor, slider)
        wait_for_rest(page)
        check_page(page, visitor)
        assert page.session.rover == LSR1 and not page.session.scenario.arm_angles
        for slider in sliders:
            wait_until(
                lambda slider=slider: (
                    visitor.slider_value(slider.label) == pytest.approx(slider.wanted())
                ),
                f"{slider.label} as it was",
            )
        visitor.open_tab("Drive")
        visitor.press("Play")
        wait_until(lambda: page.playback.time > 0.0, "the rover to drive")
