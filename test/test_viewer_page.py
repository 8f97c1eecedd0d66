"""The page in a real browser: what its buttons, sliders and clicks do, as a visitor sees it."""

import re
import shutil
import time
from collections.abc import Iterator

import numpy as np
import pytest
from grounds import make_terrain, waves

from rover_physics.rover import load_rover
from rover_physics.terrain import Terrain
from rover_planner.viewer.page import Page
from rover_planner.viewer.session import ViewSession

viser = pytest.importorskip("viser", reason="no viser: pip install '.[view]'")
sync_api = pytest.importorskip(
    "playwright.sync_api", reason="no playwright: pip install '.[test]'"
)

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
BROWSER = next(filter(None, map(shutil.which, BROWSERS)), None)
ARGUMENTS = [
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--no-sandbox",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
WAIT = 30_000.0
"""Longest wait for anything on the page [ms]."""

pytestmark = pytest.mark.skipif(
    BROWSER is None, reason=f"no browser installed: none of {', '.join(BROWSERS)} is on the path"
)


def walled() -> Terrain:
    """Return waves with a wall right across that no rover climbs."""
    return make_terrain(lambda x, y: waves(x, y) + 0.5 * ((x > 2.2) & (x < 2.6)))


@pytest.fixture(scope="module")
def page() -> Iterator[Page]:
    session = ViewSession(load_rover("lsr1"), walled(), (-2.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    served = Page(session, port=0)
    yield served
    served.close()


@pytest.fixture(scope="module")
def browser() -> Iterator[object]:
    with sync_api.sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=BROWSER, args=ARGUMENTS)
        yield chromium
        chromium.close()


@pytest.fixture(scope="module")
def visit(page, browser):
    opened = browser.new_page(viewport={"width": 1280, "height": 720})
    opened.set_default_timeout(WAIT)
    opened.goto(page.url)
    opened.wait_for_selector("#board svg")
    yield opened
    opened.close()


@pytest.fixture
def tab(visit):
    visit.get_by_role("tab", name="Drive").click()
    press(visit, "Pause")
    return visit


def press(tab, name: str) -> None:
    tab.get_by_role("button", name=name, exact=True).or_(
        tab.get_by_text(name, exact=True)
    ).first.click()


def board(tab) -> str:
    return tab.inner_text("#board")


def rover_time(tab) -> float:
    return float(re.search(r"Time\s+([\d.]+) s", board(tab)).group(1))


def wait_for(tab, text: str) -> None:
    tab.wait_for_function(f"document.body.innerText.includes({text!r})")


def wait_until(condition, what: str) -> None:
    end = time.monotonic() + WAIT / 1000.0
    while not condition():
        assert time.monotonic() < end, f"waited for {what}"
        time.sleep(0.05)


def test_the_page_shows_the_rover_its_loads_and_the_verdict(tab):
    text = board(tab)
    assert len(re.findall(r"\d+\.\d N\b", text)) == 6
    assert "stability margin" in text
    assert "traversable" in tab.inner_text("#verdict")
    assert tab.query_selector("canvas") is not None


def test_all_of_the_drive_panel_is_on_a_laptop_screen(tab):
    state = tab.locator("#state").first.bounding_box()
    assert state["y"] + state["height"] <= 720


def test_play_moves_the_rover_and_pause_stops_it(tab, page):
    press(tab, "Rewind")
    wait_until(lambda: page.playback.time == 0.0, "the start")
    before = tab.locator("canvas").first.screenshot()
    press(tab, "Play")
    wait_until(lambda: rover_time(tab) > 5.0, "time to pass")
    wait_for(tab, "playing")
    press(tab, "Pause")
    wait_for(tab, "paused")
    stopped = page.playback.time
    assert 0.0 < stopped < page.playback.duration
    time.sleep(0.3)
    assert page.playback.time == stopped
    assert tab.locator("canvas").first.screenshot() != before


def test_fast_forward_is_faster_than_play_and_rewind_goes_back(tab, page):
    press(tab, "Fast forward")
    wait_for(tab, "fast forward, 40 times as fast")
    wait_until(lambda: page.playback.time > 0.5 * page.playback.duration, "half of the way")
    press(tab, "Rewind")
    wait_for(tab, "rewinding")
    wait_until(lambda: page.playback.time == 0.0, "the start")
    wait_until(lambda: rover_time(tab) == 0.0, "the board to show it")


def test_step_goes_to_the_next_waypoint(tab, page):
    press(tab, "Rewind")
    wait_until(lambda: page.playback.time == 0.0 and page.playback.rate == 0.0, "the start")
    press(tab, "Step")
    times = page.session.shown.journey.times
    wait_until(lambda: page.playback.time == pytest.approx(times[1]), "the next waypoint")


def set_slider(tab, label: str, value: str) -> None:
    row = tab.get_by_text(label, exact=True).locator("xpath=ancestor::*[.//input][1]")
    box = row.locator("input").last
    box.fill(value)
    box.press("Enter")


def test_a_slider_changes_the_rover_and_the_path_is_judged_again(tab, page):
    tab.get_by_role("tab", name="Rover").click()
    set_slider(tab, "friction [-]", "0.2")
    wait_until(lambda: page.session.rover.friction == 0.2, "the friction")
    used = page.session.shown.verdict.max_friction_utilisation
    set_slider(tab, "friction [-]", "0.8")
    wait_until(lambda: page.session.rover.friction == 0.8, "the friction")
    assert used > 2.0 * page.session.shown.verdict.max_friction_utilisation


def test_a_value_that_makes_no_rover_is_refused_with_the_reason(tab, page):
    tab.get_by_role("tab", name="Rover").click()
    good = page.session.rover
    set_slider(tab, "rear wheel x [m]", "0.0")
    wait_for(tab, "refused: ")
    assert "rear" in tab.inner_text("#refusal")
    assert page.session.rover == good
    set_slider(tab, "rear wheel x [m]", "-0.4")
    wait_until(lambda: not page.session.refusal, "a rover that can be")


def click_ground(tab, x: float, y: float) -> None:
    tab.mouse.click(x, y)


def test_a_click_on_the_ground_sets_the_goal_and_is_judged_at_once(tab, page):
    page.session.plan_to(np.array([1.0, 0.0]))
    goal = page.session.goal
    click_ground(tab, 560, 420)
    wait_until(lambda: page.session.goal != goal, "another goal")
    x, y, _ = page.session.goal
    assert abs(x) < 5.0 and abs(y) < 5.0
    assert tab.inner_text("#verdict")


def test_a_path_through_a_wall_is_refused_and_its_reason_is_shown(tab, page):
    page.session.plan_to(np.array([3.2, 0.0]))
    page._take_answer()
    wait_for(tab, "not traversable")
    assert page.session.shown.verdict.reason in tab.inner_text("#verdict")
    assert not page.session.answer.traversable


def test_the_ground_can_be_coloured_by_what_is_predicted(tab):
    tab.get_by_role("tab", name="Ground and path").click()
    before = tab.locator("canvas").first.screenshot()
    choose(tab, "Colour by", "slope")
    wait_for(tab, "0.00 to 0.61 rad")
    wait_until(lambda: tab.locator("canvas").first.screenshot() != before, "other colours")


def choose(tab, label: str, option: str) -> None:
    row = tab.get_by_text(label, exact=True).locator("xpath=ancestor::*[.//input][1]")
    row.locator("input:visible").first.click()
    tab.get_by_role("option", name=option, exact=True).click()
