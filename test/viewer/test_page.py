# SPDX-License-Identifier: Apache-2.0
"""The page in a real browser: one visit to one page, from its opening until its program ends."""

import re
from dataclasses import replace
from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from support.viewer.browser import (
    LAPTOP,
    SCALE,
    WAIT,
    Visitor,
    needs_browser,
    open_browser,
    wait_until,
)
from support.viewer.sessions import LSR1, ask, blocked_session, wait_for_rest

pytest.importorskip("viser", reason="no viser: pip install '.[view]'")

from rover_planner.viewer.pages.page import Page

pytestmark = [needs_browser, pytest.mark.slow]

MIDDLE, SKY = (720, 480), (750, 110)
"""Points of the screen beside the notices of viser, on the ground and beside it [px]."""
FRICTION = "friction [-]"


@pytest.fixture(scope="module")
def page():
    """A page at rest; of its paths around a block one passes, and beyond the goal is a wall."""
    served = Page(blocked_session(), port=0)
    wait_for_rest(served)
    served.home = served.session.wanted
    yield served
    served.close()


@pytest.fixture(scope="module")
def browser():
    with open_browser() as chromium:
        yield chromium


@pytest.fixture(scope="module")
def visitor(page, browser):
    """A visitor of the page; neither may tell an error at the end."""
    opened = Visitor(browser, page.url)
    yield opened
    assert opened.page_errors == [] and page.errors.messages == {}


def show_refused(page: Page) -> None:
    """Show the first path that is refused, judged under all policies."""
    verdicts = [candidate.verdict for candidate in page.session.shown.candidates]
    index = next(k for k, verdict in enumerate(verdicts) if not verdict.traversable)
    ask(page, lambda: page.session.show_candidate(index))
    wait_for_rest(page)
    assert page.session.shown.index == index


def test_the_page_opens_with_verdict_loads_and_header_on_the_screen_of_a_laptop(visitor, page):
    assert visitor.text("#verdict").startswith("traversable")
    dashboard = visitor.text("#dashboard")
    loads = [float(part.split()[-1]) for part in dashboard.split(" N")[:6]]
    assert sum(loads) == pytest.approx(LSR1.weight, rel=0.1)
    for name in ("Time", "Distance", "Energy", "Speed", "stability", "worst so far"):
        assert name in dashboard
    header = visitor.text("#header")
    for word in ("traversable", "paused", "lsr1", "blocked.npz", "firm, friction 0.8", "planning"):
        assert word in header
    show_refused(page)
    visitor.tab.get_by_role("button", name="Go to the failure").wait_for()
    for selector in ("#verdict:visible", "#dashboard", "#status", "#lanes", "#plots-legend"):
        box = visitor.tab.locator(selector).bounding_box()
        assert box["y"] >= 0.0 and box["y"] + box["height"] <= LAPTOP["height"], selector
    visitor.press("Got it")
    visitor.tab.locator("#hint").wait_for(state="hidden")


def test_buttons_keys_typed_times_and_clicks_on_lanes_and_plots_move_the_drive(visitor, page):
    ask(page, lambda: page.session.show_candidate(page.session.shown.answer.nearest))
    wait_for_rest(page)
    trajectory, keyboard = page.session.shown.trajectory, visitor.tab.keyboard

    def wait_for_time(there: float, what: str, within: float = 0.06) -> None:
        wait_until(lambda: abs(page.playback.time - there) < within, what)

    visitor.press("Play")
    wait_until(lambda: visitor.number("Distance") > 5.0, "the rover to drive")
    visitor.press("Pause")
    wait_until(lambda: page.playback.rate == 0.0, "the rover to stand")
    visitor.press("To the start")
    wait_for_time(0.0, "the start")
    for key, row in (("ArrowRight", 1), ("ArrowRight", 2), ("ArrowLeft", 1)):
        keyboard.press(key)
        wait_for_time(trajectory.times[row], key)
    keyboard.press("Space")  # it is the drive's, although a button was pressed before
    wait_until(lambda: page.playback.rate == 1.0, "it to play")
    keyboard.press("Space")
    wait_until(lambda: page.playback.rate == 0.0, "it to pause")
    visitor.type_number("Time [s]", "12.5")
    wait_for_time(12.5, "the typed time")
    wait_until(lambda: visitor.number("Time") == 12.5, "the board to show it")
    for curves, share in (("#lanes svg", 0.5), (".u-over", 0.25)):
        visitor.click_share(curves, share)
        there = np.interp(share * trajectory.distance[-1], trajectory.distance, trajectory.times)
        wait_for_time(float(there), f"{share} of the path", 1.0)


def test_a_row_of_the_table_is_selected_by_click_and_by_key_and_a_refusal_leads_to_its_place(
    visitor, page
):
    visitor.open_tab("Ground and path")
    rows = visitor.tab.locator("#candidates tr[tabindex]")
    for index, select in (
        (1, lambda row: row.click()),
        (0, lambda row: (row.focus(), visitor.tab.keyboard.press("Enter"))),
    ):
        select(rows.nth(index))
        wait_until(lambda index=index: page.session.shown.index == index, f"path {index + 1}")
        wait_for_rest(page)
        chosen = f"#candidates tbody:nth-of-type({index + 2}) tr[aria-selected=true]"
        wait_until(lambda chosen=chosen: visitor.tab.locator(chosen).count() == 1, "its mark")
    show_refused(page)
    visitor.open_tab("Drive")
    failure = page.judged.failure
    visitor.wait_for(failure.headline)
    visitor.press("Go to the failure")
    wait_until(lambda: abs(page.playback.time - failure.time) < 0.05, "the failure")
    there = pytest.approx(100.0 * failure.distance, abs=0.2)
    wait_until(lambda: visitor.number("Distance") == there, "the board to show it")
    camera = max(page.server.get_clients().items())[1].camera
    wait_until(
        lambda: np.allclose(camera.look_at, failure.state.position, atol=1e-3),
        "the camera to look there",
    )
    visitor.press("Fit")


def test_a_typed_or_dragged_number_is_judged_and_an_impossible_one_is_refused(visitor, page):
    session = page.session
    visitor.open_tab("Rover")
    visitor.type_number(FRICTION, "0.55")
    wait_until(lambda: session.rover.friction == 0.55, "the typed value")
    visitor.type_number(FRICTION, "99")
    wait_until(lambda: visitor.slider_value(FRICTION) == 2.0, "the end of the slider")
    visitor.drag_slider(FRICTION, 0.25)
    wait_until(lambda: session.rover.friction == pytest.approx(0.62, abs=0.02), "a quarter")
    wait_for_rest(page)
    wait_until(lambda: visitor.slider_value(FRICTION) == session.rover.friction, "the box")
    wait_until(lambda: "lsr1 (changed)" in visitor.text("#header"), "the header")
    good = session.rover
    visitor.type_number("middle wheel x [m]", "0.6")
    wait_until(lambda: "suspension.wheels.front" in visitor.text("#refusal"), "the reason")
    wait_until(lambda: visitor.slider_value("middle wheel x [m]") == 0.0, "the last good value")
    assert session.rover == good
    visitor.press("Reset")
    wait_until(lambda: session.rover == LSR1, "the loaded rover")
    wait_for_rest(page)


def test_a_click_sets_the_goal_one_into_the_sky_is_refused_and_one_on_a_number_shows_its_path(
    visitor, page
):
    session, goal = page.session, page.session.scenario.goal
    visitor.open_tab("Ground and path")
    visitor.tab.mouse.click(*SKY)
    visitor.wait_for("refused: the click is beside the known ground")
    visitor.tab.mouse.click(*MIDDLE)
    wait_until(lambda: session.scenario.goal != goal, "another goal")
    assert max(map(abs, session.scenario.goal[:2])) < 4.0
    wait_for_rest(page)
    other = (session.shown.index + 1) % len(session.shown.candidates)
    camera = max(page.server.get_clients().items())[1].camera
    place, goal, told = page.scene.paths._numbers[other], session.scenario.goal, []
    camera.on_update(told.append)
    camera.position = place + np.array([-2.0, 0.0, 2.0])
    camera.look_at = place  # the number is in the middle
    wait_until(lambda: told, "the browser's camera")
    visitor.tab.wait_for_timeout(1000)
    box = visitor.tab.locator("canvas").first.bounding_box()
    visitor.tab.mouse.click(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
    wait_until(lambda: session.shown.index == other, "the path of the number")
    assert session.scenario.goal == goal


def test_a_layer_colours_the_ground_and_a_soil_lets_wheels_sink(visitor, page):
    visitor.open_tab("Ground and path")
    visitor.choose("Colour by", "tilt")
    visitor.wait_for("29.79 deg")
    visitor.choose("Soil", "dry_sand")
    wait_until(lambda: page.session.shown.verdict.max_sinkage > 0.0, "wheels that sink")
    visitor.choose("Soil", "none (Coulomb)")
    wait_until(lambda: page.session.scenario.options.model.soil is None, "hard ground")
    wait_for_rest(page)


def test_what_is_shown_is_sent_as_a_link_and_as_a_file_that_needs_no_network(
    visitor, page, browser, tmp_path
):
    session = page.session
    changed = replace(page.home, rover=replace(LSR1, friction=0.6))
    ask(page, lambda: session.take_scenario(changed))
    wait_for_rest(page)
    show_refused(page)
    ask(page, lambda: page.playback.go_to(2.0))
    shown, at = session.shown, page.playback.time
    visitor.open_tab("Share")
    visitor.press("Link to what is shown")
    query = visitor.tab.get_attribute("#link", "href")
    assert f"path={shown.index + 1}" in query and "layer=tilt" in query
    with visitor.tab.expect_download() as download:
        visitor.press("Save as HTML file")
    download.value.save_as(tmp_path / "refusal.html")
    ask(page, lambda: page._restore(LSR1, {}))
    ask(page, lambda: page.plan(np.array([0.5, 0.5])))
    wait_for_rest(page)
    visitor.tab.goto(f"{page.url}/{query}")
    wait_until(lambda: session.rover.friction == 0.6, "the friction")
    wait_until(lambda: session.shown.index == shown.index, "the path")
    wait_until(lambda: page.playback.time == pytest.approx(at, abs=1e-3), "the time")
    np.testing.assert_array_equal(session.shown.candidate.poses, shown.candidate.poses)
    wait_for_rest(page)

    context = browser.new_context(viewport=LAPTOP, offline=True, device_scale_factor=SCALE)
    tab = context.new_page()
    tab.set_default_timeout(1000.0 * WAIT)
    tab.goto((tmp_path / "refusal.html").as_uri())
    tab.wait_for_selector("canvas")
    report = tab.inner_text("#report")
    for word in ("not traversable", "blocked.npz", "refused at", "rover_planner ", "map="):
        assert word in report
    assert re.search(rf"waypoint {shown.verdict.first_failure}\b", report)
    tab.add_style_tag(content="#report { display: none; }")

    def contrast() -> float:
        colours = np.asarray(Image.open(BytesIO(tab.locator("canvas").first.screenshot())))
        return float(colours[..., :3].reshape(-1, 3).std(axis=0).max())

    wait_until(lambda: contrast() > 20.0, "a scene, not one colour")
    context.close()


def test_a_visitor_of_a_page_that_ends_is_told(visitor, page):
    assert not visitor.tab.locator("#lost").is_visible()
    page.close()  # this is the last test of the page
    visitor.wait_for("No connection to the program")
