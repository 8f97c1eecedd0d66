# SPDX-License-Identifier: Apache-2.0
"""Writes the pictures of docs/viewer.md: `python -m benchmarks.viewer_pictures docs`."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from benchmarks.grounds import real_maps
from rover_physics.names import WHEELS
from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.grid import Terrain, load_terrain
from rover_planner.command.view import SEED, TERRAIN_SIZE, choose_ends
from rover_planner.viewer.pages.page import Page
from rover_planner.viewer.state.scenario import Pose, Scenario
from rover_planner.viewer.state.session import ViewSession
from rover_planner.worlds.mars_terrain import make_mars_terrain
from support.viewer.browser import Visitor, open_browser
from support.viewer.sessions import wait_for_rest
from support.viewer.sessions import wait_patiently as wait_until

SETTLE = 10.0
"""Time for the browser to draw before a picture is taken [s]."""
MAX_GAP = 0.2
"""Gaps in maps up to this width are filled, as `rover_planner view` does [m]."""


def make_ground() -> Terrain:
    """Return the ground that the page makes without one."""
    return make_mars_terrain(SEED, TERRAIN_SIZE, 0.05)


MADE = f"made, seed {SEED}"
CASES: dict[str, tuple[str, Callable[[], Terrain], tuple[Pose, Pose] | None]] = {
    "viewer.png": (MADE, make_ground, None),
    "viewer_made.png": (MADE, make_ground, None),
    "viewer_spirit.png": (
        "spirit",
        lambda: load_terrain("spirit").fill_gaps(MAX_GAP),
        ((-47.2, -21.0, 1.2), (-45.7, -17.1, 1.2)),
    ),
    "viewer_otira.png": (
        "otira_tls_boulders_3cm",
        lambda: real_maps()["otira_tls_boulders_3cm"].fill_gaps(MAX_GAP),
        ((20.3, 17.4, 0.0), (23.4, 17.4, 0.0)),
    ),
}
"""Name of the ground, the ground, and start and goal (None: those that `rover_planner view`
chooses) of each picture. The first shows the page as it opens, the others a refused path."""


def _write(browser: Any, file: Path) -> str:
    """Write one picture; return what it shows."""
    name, make, ends = CASES[file.name]
    rover, ground = load_rover("lsr1"), make()
    session = ViewSession(Scenario(rover, rover, ground, *(ends or choose_ends(rover, ground))))
    page = Page(session, ground_name=name)
    try:
        wait_for_rest(page)
        visitor = Visitor(browser, page.url, scale=1.0)
        _close_notice(visitor)
        shows = _show_drive(page) if file.name == "viewer.png" else _show_failure(page, visitor)
        time.sleep(SETTLE)  # what changes while a page opens may be drawn once more
        file.write_bytes(visitor.tab.screenshot())
        visitor.tab.close()
    finally:
        page.close()
    return shows


def _close_notice(visitor: Visitor) -> None:
    """Close the browser's notice that it draws without a graphics card."""
    scene = visitor.tab.frame_locator("#scene")
    notice = scene.get_by_text("Software WebGL rendering detected")
    notice.wait_for()
    notice.locator("xpath=ancestor::*[.//button][1]").get_by_role("button").first.click()
    notice.wait_for(state="detached")


def _show_failure(page: Page, visitor: Visitor) -> str:
    """Show the first candidate that a wheel refuses, at its failure; return what fails."""
    session = page.session
    for index, path in enumerate(session.shown.paths):
        if path.verdict.traversable:
            continue
        page.hear({"ask": "show", "index": index})
        wait_until(lambda index=index: session.shown.index == index, "the path")
        wait_for_rest(page)
        failure = session.shown.path.failure
        if failure is not None and failure.link in WHEELS:
            visitor.press("Go to the failure")
            at = min(failure.state.time, page.playback.duration)
            wait_until(lambda at=at: abs(page.playback.time - at) < 1e-6, "the failure")
            return failure.headline
    raise AssertionError("no candidate is refused because of a wheel")


def _show_drive(page: Page) -> str:
    """Show the rover after a third of its drive."""
    page.hear({"ask": "seek", "time": page.playback.duration / 3.0})
    return page.session.shown.verdict.reason or "traversable"


def main(folder: Annotated[Path, typer.Argument(help="Folder of the pictures.")]) -> None:
    """Write the pictures and print what they show."""
    with open_browser() as browser:
        for name in CASES:
            print(f"{name}: {_write(browser, folder / name)}", flush=True)


if __name__ == "__main__":
    typer.run(main)
