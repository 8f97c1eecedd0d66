"""The page in a real browser: what a visitor sees after pressing, dragging and clicking."""

import itertools
import time
from collections.abc import Iterator

import numpy as np
import pytest

from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.grid import Terrain
from rover_planner.studies.rover_values import read_rover
from rover_planner.viewer.pages import page as page_module
from rover_planner.viewer.pages.page import Page
from rover_planner.viewer.state.reasons.explanation import explain
from rover_planner.viewer.state.session import ViewSession
from support.grounds import make_terrain, waves
from support.viewer.browser import LAPTOP, WAIT, Visitor, needs_browser, wait_until
from support.viewer.sessions import ramp
from support.viewer.visits import open_browser, wait_for_browser, wait_for_rest

pytestmark = [needs_browser, pytest.mark.slow]

LSR1 = load_rover("lsr1")
MIDDLE = (720, 420)
"""A point of the screen on the ground, beside the notices of viser [px]."""


def walled() -> Terrain:
    """Return waves with a wall along y that no rover climbs."""
    return make_terrain(lambda x, y: waves(x, y) + 0.5 * ((x > 2.2) & (x < 2.6)))


@pytest.fixture(scope="module")
def page() -> Iterator[Page]:
    session = ViewSession(LSR1, walled(), (-2.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    served = Page(session, port=0)
    yield served
    served.close()


@pytest.fixture(scope="module")
def browser() -> Iterator[object]:
    with open_browser() as chromium:
        yield chromium


@pytest.fixture(scope="module")
def opened(page, browser) -> Visitor:
    return Visitor(browser, page.url)


@pytest.fixture
def visitor(opened, page) -> Visitor:
    """A visitor at the start of the path from (-2, 0) to (1, 0), with the preset lsr1."""

    def reset() -> None:
        page.session.move(start=(-2.0, 0.0, 0.0))
        if page.session.rover != LSR1:
            page.session.take_rover(LSR1)
        page.plan(np.array([1.0, 0.0]))
        done.append(True)

    done: list[bool] = []
    page.requests.add(reset)
    wait_until(lambda: done, "the start")
    wait_for_rest(page)
    wait_for_browser(page, opened)
    opened.open_tab("Drive")
    opened.wait_for("paused")
    wait_until(lambda: opened.number("Time") == 0.0, "the dashboard to show the start")
    return opened


@pytest.fixture
def slowly(page, monkeypatch) -> None:
    """The drive takes 100 s, so that it is not over before the browser has shown it."""
    monkeypatch.setattr(page.playback, "speed", 1.0)


def test_the_page_shows_the_rover_its_loads_and_the_verdict(visitor):
    assert "traversable" in visitor.text("#verdict")
    dashboard = visitor.text("#dashboard")
    assert dashboard.count(" N\n") + dashboard.endswith(" N") >= 6
    loads = [float(part.split()[-1]) for part in dashboard.split(" N")[:6]]
    assert sum(loads) == pytest.approx(LSR1.weight, rel=0.1)
    for name in (
        "Time",
        "Distance",
        "Energy",
        "Speed",
        "stability",
        "T/(\u03bcN)",
        "worst so far",
    ):
        assert name in dashboard
    assert not visitor.page_errors


def is_seen(visitor: Visitor, selector: str) -> bool:
    """Return whether all of an element is on a laptop's screen."""
    box = visitor.tab.locator(selector).bounding_box()
    return box is not None and box["y"] >= 0.0 and box["y"] + box["height"] <= 720.0


def assert_seen(visitor: Visitor) -> None:
    """Assert that nothing of the drive tab is below the edge of the screen once it is drawn."""
    for selector in ("#verdict:visible", "#dashboard", "#status", "#plots-legend"):
        wait_until(lambda selector=selector: is_seen(visitor, selector), f"{selector} in sight")


def test_the_drive_tab_fits_on_the_screen_of_a_laptop(visitor):
    assert_seen(visitor)


def test_play_moves_the_rover_and_pause_stops_it(visitor, page, slowly):
    before = visitor.picture()
    visitor.press("Play")
    visitor.wait_for("playing")
    wait_until(lambda: visitor.number("Distance") > 5.0, "the rover to drive")
    visitor.press("Pause")
    visitor.wait_for("paused")
    stopped = page.playback.time
    assert 0.0 < stopped < page.playback.duration
    wait_until(lambda: visitor.number("Time") == pytest.approx(stopped, abs=0.1), "the dashboard")
    wait_until(lambda: visitor.picture() != before, "the rover elsewhere")
    assert page.playback.time == stopped


def test_fast_forward_is_faster_than_play_and_rewind_goes_back(visitor, page, slowly):
    half = 0.5 * page.playback.duration
    page.requests.add(lambda: page.playback.go_to(0.95 * half))
    visitor.press("Fast forward")
    visitor.wait_for("fast forward, 4 times as fast")
    wait_until(lambda: page.playback.time > half, "half of the way")
    visitor.press("Rewind")
    visitor.wait_for("rewinding")
    page.playback.speed = 10.0
    wait_until(lambda: page.playback.time == 0.0, "the start")
    wait_until(lambda: visitor.number("Time") == 0.0, "the dashboard to show it")


def test_step_goes_to_the_next_waypoint_and_step_back_to_the_previous(visitor, page):
    times = page.session.shown.trajectory.times
    for press, row in (("Step", 1), ("Step", 2), ("Step back", 1)):
        visitor.press(press)
        there = times[row]
        wait_until(lambda there=there: page.playback.time == pytest.approx(there), f"row {row}")
    wait_until(
        lambda: visitor.number("Time") == pytest.approx(times[1], abs=0.06), "the dashboard"
    )


def test_the_scrubber_moves_the_drive_and_the_cursor_of_the_plots_to_its_time(visitor, page):
    wait_until(lambda: visitor.tab.locator(".uplot canvas").count() == 3, "the plots")
    visitor.set_slider("Time [s]", "50")
    wait_until(lambda: page.playback.time == pytest.approx(50.0), "50 s")
    wait_until(lambda: visitor.number("Time") == 50.0, "the dashboard to show it")
    assert visitor.number("Distance") == pytest.approx(150.0, rel=0.05)
    distance = page.session.shown.trajectory.state_at(50.0).distance
    data = page.plots.plots["wheel_loads"]
    wait_until(lambda: np.any(np.isclose(data.data[0], distance)), "the cursor to be there")
    assert all(np.isfinite(column).all() for column in data.data)


def test_every_typed_time_takes_effect_although_the_page_moves_the_scrubber_too(visitor, page):
    for typed in ("50", "50", "7.5", "61.2"):
        visitor.set_slider("Time [s]", typed)
        wait_until(lambda typed=typed: page.playback.time == float(typed), f"{typed} s")
        visitor.press("To the start")
        wait_until(lambda: visitor.slider_value("Time [s]") == 0.0, "the start")


def test_a_time_typed_while_it_plays_is_not_overwritten_and_counts_on_enter(visitor, page, slowly):
    page.requests.add(lambda: page.playback.go_to(50.0))
    visitor.press("Play")
    box = visitor._row("Time [s]").locator("input").last
    wait_until(lambda: float(box.input_value()) > 50.2, "the box to follow the drive")
    box.click()
    shown, then = box.input_value(), page.playback.time
    wait_until(lambda: page.playback.time > then + 0.7, "the drive to go on")
    assert box.input_value() == shown
    box.press("Control+a")
    for text in ("1", "12", "12.", "12.5"):
        box.press(text[-1])
        then = page.playback.time
        wait_until(lambda then=then: page.playback.time > then + 0.3, "the drive to go on")
        assert box.input_value() == text
    box.press("Enter")
    wait_until(lambda: page.playback.time == 12.5, "the typed time")
    wait_until(lambda: box.input_value() == "12.5", "the box to show it")
    visitor.press("Play")  # it leaves the box
    wait_until(lambda: float(box.input_value()) > 12.7, "the box to follow the drive again")
    box.click()
    then = page.playback.time
    wait_until(lambda: page.playback.time > then + 0.3, "the drive to go on")
    visitor.press("Pause")
    end = page.playback.time
    wait_until(lambda: float(box.input_value()) == pytest.approx(end, abs=0.06), "the end")


def are_apart(parts: list) -> bool:
    """Return whether parts of the page stand one above the other."""
    boxes = sorted((part.bounding_box() for part in parts), key=lambda box: box["y"])
    pairs = itertools.pairwise(boxes)
    return all(above["y"] + above["height"] <= below["y"] for above, below in pairs)


def test_header_hint_and_notices_do_not_hide_each_other(visitor):
    notice = visitor.tab.locator(".mantine-Notification-root").first
    assert "Software WebGL" in notice.inner_text()
    for width in (LAPTOP["width"], 900):
        visitor.tab.set_viewport_size({**LAPTOP, "width": width})
        scene = visitor.tab.locator("canvas").first
        wait_until(lambda: (scene.bounding_box()["x"] > 20.0) == (width >= 1000), "the panels")  # noqa: B023
        shown = [visitor.tab.locator("#header"), visitor.tab.locator("#hint"), notice]
        wait_until(lambda: are_apart(shown), f"header, hint and notice apart, {width} px wide")  # noqa: B023
    visitor.tab.set_viewport_size(LAPTOP)
    wait_until(lambda: scene.bounding_box()["x"] > 20.0, "the panels side by side")


def test_a_time_typed_just_before_the_page_moves_the_scrubber_takes_effect(visitor, page):
    scrubber = page.drive_tab._controls._scrubber

    def show_late(typed: float) -> None:
        """Keep the page's thread busy until the visitor's time has come."""
        ready.append(typed)
        end = time.monotonic() + WAIT
        while scrubber.value != typed and time.monotonic() < end:
            pass
        page.drive_tab.move_scrubber()

    for typed in range(1, 10):
        ready: list[float] = []
        wait_until(lambda: page.drive_tab._held_until is None, "the last time to be shown")
        page.requests.add(lambda typed=typed: show_late(typed))
        wait_until(lambda ready=ready: ready, "the page's thread")
        visitor.set_slider("Time [s]", f"{typed}")
        wait_until(lambda typed=typed: page.playback.time == typed, f"{typed} s")
        wait_until(
            lambda typed=typed: visitor.slider_value("Time [s]") == typed, "the box to show it"
        )


def test_a_slider_changes_the_rover_and_the_path_is_judged_again(visitor, page, monkeypatch):
    monkeypatch.setattr(page_module, "REPLAN_DELAY", WAIT)  # what is told of the path stays
    used = page.session.shown.verdict.max_friction_utilisation
    visitor.open_tab("Rover")
    visitor.set_slider("friction [-]", "0.4")
    wait_until(lambda: page.session.rover.friction == 0.4, "the friction")
    visitor.wait_for("judged again in")
    now = page.session.shown.verdict.max_friction_utilisation
    assert now == pytest.approx(2.0 * used, rel=0.01)


def test_a_dragged_slider_ends_at_its_last_value(visitor, page):
    visitor.open_tab("Rover")
    visitor.drag_slider("friction [-]", 0.25)
    last = pytest.approx(0.62, abs=0.011)  # a quarter of 0.16 to 2
    wait_until(lambda: visitor.slider_value("friction [-]") == last, "the box to show it")
    shown = visitor.slider_value("friction [-]")
    wait_until(lambda: page.session.rover.friction == pytest.approx(shown), "the last value")


def test_a_link_length_changes_the_rover_in_the_scene(visitor, page):
    visitor.open_tab("Rover")
    before = visitor.picture()
    visitor.set_slider("front wheel x [m]", "0.6")
    wait_until(lambda: page.session.rover.suspension.wheels["front"][0] == 0.6, "the wheel")
    wait_until(lambda: visitor.picture() != before, "another figure")


def test_an_impossible_value_is_refused_with_the_reason(visitor, page):
    good = page.session.rover
    visitor.open_tab("Rover")
    visitor.set_slider("middle wheel x [m]", "0.4")
    visitor.wait_for("refused: ")
    assert "suspension.wheels.front" in visitor.text("#refusal")
    assert page.session.rover == good
    wait_until(lambda: visitor.slider_value("middle wheel x [m]") == 0.0, "the last good value")


def test_a_rover_file_can_be_saved_and_loaded(visitor, page, tmp_path):
    visitor.open_tab("Rover")
    visitor.set_slider("friction [-]", "0.5")
    wait_until(lambda: page.session.rover.friction == 0.5, "the friction")
    with visitor.tab.expect_download() as download:
        visitor.press("Save as rover file")
    file = tmp_path / "rover.yaml"
    download.value.save_as(file)
    assert read_rover(file.read_text(), "saved") == page.session.rover
    file.write_text(file.read_text().replace("name: lsr1", "name: mine"))
    with visitor.tab.expect_file_chooser() as chooser:
        visitor.press("Load a rover file")
    chooser.value.set_files(file)
    wait_until(lambda: page.session.rover.name == "mine", "the loaded rover")


def test_a_click_on_the_ground_sets_the_goal_and_plans_at_once(visitor, page):
    goal, start = page.session.goal, page.session.start
    visitor.click_scene(*MIDDLE)
    wait_until(lambda: page.session.goal != goal, "another goal")
    x, y, _ = page.session.goal
    assert abs(x) < 4.0 and abs(y) < 4.0
    assert page.session.start == start
    wait_until(lambda: "candidate paths" in visitor.text("#details"), "all candidates")


def test_a_click_with_shift_sets_the_start(visitor, page):
    goal, start = page.session.goal, page.session.start
    visitor.click_scene(*MIDDLE, shift=True)
    wait_until(lambda: page.session.start != start, "another start")
    assert page.session.goal[:2] == goal[:2]


def test_a_refused_click_is_answered_in_every_tab(visitor):
    visitor.open_tab("Ground and path")
    visitor.click_scene(600, 100)  # the sky
    visitor.wait_for("refused: the click is beside the known ground")
    visitor.click_scene(*MIDDLE)
    visitor.tab.locator("#refusal").wait_for(state="hidden")


def test_a_path_through_a_wall_is_refused_and_its_reason_is_shown(visitor, page):
    before = visitor.picture()
    page.requests.add(lambda: page.plan(np.array([3.4, 0.0])))
    visitor.wait_for("not traversable")
    wait_until(lambda: not page.is_busy, "all verdicts")
    assert not page.session.answer.traversable
    failure = explain(page.session.finished).failure
    wait_until(lambda: failure.headline in visitor.text("#verdict"), "the broken limit")
    reason = page.session.shown.verdict.reason
    wait_until(lambda: reason in visitor.text("#details"), "the reason")
    wait_until(lambda: visitor.picture() != before, "ghosts in the scene")


def test_the_board_of_a_refused_path_is_seen_without_scrolling(visitor, page):
    page.requests.add(lambda: page.plan(np.array([3.4, 0.0])))
    visitor.tab.get_by_role("button", name="Go to the failure").wait_for()
    wait_until(lambda: not page.is_busy, "all verdicts")
    visitor.wait_for("refused")
    assert_seen(visitor)


def test_a_predicted_layer_colours_the_ground(visitor):
    visitor.open_tab("Ground and path")
    before = visitor.picture()
    assert not visitor.tab.get_by_text("Heading [deg]").is_visible()
    visitor.choose("Colour by", "tilt")
    visitor.wait_for("29.79 deg")
    visitor.tab.get_by_text("Heading [deg]").wait_for()
    wait_until(lambda: visitor.picture() != before, "other colours")
    visitor.choose("Colour by", "height")


def test_a_soil_lets_the_wheels_sink(visitor, page):
    visitor.open_tab("Ground and path")
    assert page.session.shown.verdict.max_sinkage == 0.0
    visitor.choose("Soil", "dry_sand")
    wait_until(lambda: page.session.shown.verdict.max_sinkage > 0.0, "wheels that sink")
    visitor.choose("Soil", "none (Coulomb)")
    wait_until(lambda: page.session.options.soil is None, "hard ground")


def test_a_slider_that_makes_the_shown_path_impassable_is_answered_and_the_page_goes_on(browser):
    session = ViewSession(LSR1, make_terrain(ramp), (-2.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    steep = Page(session, port=0)
    try:
        visitor = Visitor(browser, steep.url)
        visitor.wait_for("paused")
        wait_until(lambda: visitor.text("#verdict").startswith("traversable"), "the verdict")
        visitor.open_tab("Rover")
        visitor.drag_slider("friction [-]", 0.0)
        visitor.wait_for("not traversable")
        wait_until(lambda: visitor.slider_value("friction [-]") == 0.16, "the end of the slider")
        wait_until(lambda: session.rover.friction == 0.16, "the last value")
        wait_until(lambda: "slips" in visitor.text("#verdict:visible"), "the reason")
        visitor.set_slider("friction [-]", "0.9")
        wait_until(lambda: visitor.text("#verdict").startswith("traversable"), "the new verdict")
        assert visitor.page_errors == []
        assert not visitor.tab.locator("#lost").is_visible()
    finally:
        steep.close()
    visitor.wait_for("No connection to the program")
    visitor.tab.close()


def test_the_browser_reports_no_error_after_all_tests(visitor):
    assert visitor.page_errors == []
