# SPDX-License-Identifier: Apache-2.0
"""The page in a real browser: one visit to one page, from its opening until its program ends."""

from dataclasses import replace
from io import BytesIO
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

from support.viewer.browser import (
    LAPTOP,
    READ_LETTERS,
    SCALE,
    WAIT,
    Visitor,
    needs_browser,
    open_browser,
)
from support.viewer.sessions import LSR1, ask, blocked_session, held, wait_for_rest
from support.viewer.sessions import wait_patiently as wait_until

pytest.importorskip("viser", reason="no viser: pip install '.[view]'")

from rover_planner.viewer.documents.paths import write_use
from rover_planner.viewer.pages.page import Page
from rover_planner.viewer.pages.sharing import KEY

pytestmark = [needs_browser, pytest.mark.slow]

FRICTION = "friction [-]"
NAME = "blocked.npz"
READ_COLOURS = "all => all.map((it) => [it.innerText.split(',')[0], getComputedStyle(it).color])"


@pytest.fixture(scope="module")
def page():
    """A page at rest; of its paths around a block one passes, and beyond the goal is a wall."""
    served = Page(blocked_session(), ground_name=NAME)
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
    assert opened.page_errors == [] and page.errors == {}


def find_refused(page: Page) -> int:
    """Return the index of a path that is refused."""
    paths = page.session.shown.paths
    return next(k for k, path in enumerate(paths) if not path.verdict.traversable)


def wait_for_scene(page: Page):
    """Return the newest scene that has connected: its frame loads beside the page, and later."""
    wait_until(page.server.get_clients, "the scene to connect")
    return max(page.server.get_clients().items())[1]


def test_the_page_opens_with_verdict_board_and_limits_on_the_screen_of_a_laptop(visitor, page):
    assert visitor.text("#verdict .word") == "traversable"
    texts = visitor.tab.locator(".tyre + small").all_inner_texts()
    loads = [float(one.split()[0]) for one in texts]
    assert len(loads) == 6 and sum(loads) == pytest.approx(LSR1.weight, rel=0.1)
    for word in ("lsr1", NAME, "firm, friction 0.8", "planning"):
        assert word in visitor.text("#subject")
    parts = "#verdict", "#board .wheels", "#board .numbers", "#limits", "#drive", "#scene"
    for selector in parts:
        assert visitor.is_on_screen(selector), selector
    assert visitor.tab.title() == f"lsr1 on {NAME}"


def test_buttons_keys_and_clicks_on_lanes_and_curves_move_the_drive(visitor, page):
    trajectory, keyboard = page.session.shown.path.trajectory, visitor.tab.keyboard

    def wait_for_time(there: float, what: str, within: float = 0.06) -> None:
        wait_until(lambda: abs(page.playback.time - there) < within, what)

    visitor.press("Play")
    wait_until(lambda: page.playback.time > 2.0, "the rover to drive")
    visitor.press("Pause")
    wait_until(lambda: not page.playback.is_playing, "the rover to stand")
    visitor.press("To the start")
    wait_for_time(0.0, "the start")
    for key, row in (("ArrowRight", 1), ("ArrowRight", 2), ("ArrowLeft", 1)):
        keyboard.press(key)
        wait_for_time(trajectory.times[row], key)
    keyboard.press("Space")  # it is the drive's, although a button was pressed before
    wait_until(lambda: page.playback.is_playing, "it to play")
    keyboard.press("Space")
    wait_until(lambda: not page.playback.is_playing, "it to pause")
    for curves, share in ((".strip", 0.5), (".plot", 0.25)):
        visitor.click_share(curves, share)
        there = np.interp(share * trajectory.distance[-1], trajectory.distance, trajectory.times)
        wait_for_time(float(there), f"{share} of the path", 1.0)
    visitor.tab.locator('.lane[data-code="torque"]').click(position={"x": 5, "y": 5})
    visitor.wait_for("torque, use of the limit")


def test_a_row_is_taken_by_click_and_key_and_a_slider_leaves_its_path_and_offers_another(
    visitor, page
):
    session, refused = page.session, find_refused(page)
    visitor.open_tab("Paths")
    found = dict(visitor.tab.eval_on_selector_all("#paths b.mark", READ_COLOURS))
    assert found == {"passes": "rgb(0, 114, 178)", "refused": "rgb(194, 79, 0)"}
    rows = visitor.tab.locator("#paths tr[tabindex]")
    other = refused + 1
    rows.nth(other).focus()
    visitor.tab.keyboard.press("Enter")
    wait_until(lambda: session.shown.index == other, "the other path")
    rows.nth(refused).click()
    wait_until(lambda: session.shown.index == refused, "the refused path")
    wait_for_rest(page)
    visitor.open_tab("Rover")
    visitor.type_number(FRICTION, "0.85")
    wait_until(lambda: "0.85" in visitor.text("#changes"), "the changes")
    wait_for_rest(page)
    assert session.shown.index == refused
    wait_until(lambda: visitor.tab.locator(".strip i.before").count() > 5, "the lanes before")
    visitor.tab.locator("#verdict button.main").click()
    wait_until(lambda: session.shown.verdict.traversable, "the offered path")
    visitor.press("Keep as reference")
    visitor.wait_for("nothing differs from the rover as kept")
    visitor.press("Compare with loaded")
    visitor.press("Undo")
    wait_until(lambda: session.shown.scenario.rover == LSR1, "the loaded rover")
    wait_for_rest(page)


def test_a_refusal_leads_to_its_place_where_all_parts_show_one_number(visitor, page):
    ask(page, lambda: page.session.show_path(find_refused(page)))
    wait_for_rest(page)
    camera = wait_for_scene(page).camera
    path = page.session.shown.path
    visitor.wait_for(path.failure.headline)
    visitor.press("Go to the failure")
    wait_until(lambda: abs(page.playback.time - path.failure.state.time) < 0.05, "the failure")
    lane = f'.lane[data-code="{path.failure.code}"][data-broken]'
    wait_until(lambda: visitor.tab.locator(lane).count() == 1, "the broken lane")
    use = float(np.nanmax(path.limits.lane(path.failure.code).used))
    assert f"worst {write_use(use)}" in visitor.text(lane)
    place = path.failure.state.position
    wait_until(lambda: np.allclose(camera.look_at, place, atol=1e-3), "the camera to look there")


def test_a_number_of_a_slider_is_judged_and_the_reason_of_a_refused_one_stays_on_the_screen(
    visitor, page
):
    session, label, last = page.session, "torque limit [N m]", "wheel [kg]"
    visitor.open_tab("Rover")
    strong = replace(LSR1, wheel=replace(LSR1.wheel, max_torque=25.0))
    ask(page, lambda: session.take_change(replace(session.wanted, rover=strong)))
    wait_until(lambda: visitor.box(label).input_value() == "25", "a number beyond the ends")
    slider = visitor.tab.get_by_role("slider", name=label, exact=True)
    assert float(slider.input_value()) == pytest.approx(25.0, abs=0.1)
    wait_for_rest(page)  # what is drawn anew moves the slider
    slider = visitor.tab.get_by_role("slider", name=FRICTION, exact=True)
    width = slider.bounding_box()["width"]
    slider.click(position={"x": 0.25 * width, "y": 5.0})
    quarter = pytest.approx(0.6, abs=0.06)
    wait_until(lambda: session.shown.scenario.rover.friction == quarter, "a quarter")

    def is_in_the_box() -> bool:
        return float(visitor.box(FRICTION).input_value()) == session.wanted.rover.friction

    wait_until(is_in_the_box, "the box")
    visitor.box(FRICTION).fill("0.001")
    visitor.tab.keyboard.press("Enter")
    wait_until(lambda: session.wanted.rover.friction > 0.001, "the end of the slider")
    wait_until(is_in_the_box, "the end in the box that is still typed in")
    wait_for_rest(page)
    friction = session.wanted.rover.friction
    visitor.tab.locator("#sliders summary", has_text="Masses").click()
    visitor.box(last).scroll_into_view_if_needed()
    visitor.type_number("middle wheel x [m]", "0.6")
    visitor.box(last).scroll_into_view_if_needed()
    wait_until(lambda: "suspension.wheels.front" in visitor.text("#refusal"), "the reason")
    assert visitor.is_on_screen("#refusal") and visitor.is_on_screen("#verdict .word")
    assert visitor.text("body").count("suspension.wheels.front") == 1  # once, not in each part
    wait_until(lambda: visitor.box("middle wheel x [m]").input_value() == "0", "the good value")
    assert session.wanted.rover.friction == friction
    visitor.press("Reset")
    wait_until(lambda: session.shown.scenario.rover == LSR1, "the loaded rover")
    wait_for_rest(page)
    assert visitor.box(label).get_attribute("max") == "25"  # it can be dragged back


def test_a_button_that_is_pressed_while_what_it_stands_on_is_told_anew_takes_the_click(
    visitor, page
):
    visitor.press("To the start")
    visitor.tab.wait_for_timeout(4000)  # the longest press is 5 s: this one must not end the next
    with held(page.session):
        page.hear({"ask": "value", "label": FRICTION, "value": 0.75})
        visitor.tab.get_by_role("button", name="Cancel").hover()
        visitor.tab.mouse.down()
        for _ in range(2):
            told = page.channel.parts["verdict"]["judging"]
            wait_until(lambda t=told: page.channel.parts["verdict"]["judging"] != t, "a second")
        visitor.tab.wait_for_timeout(300)
        visitor.tab.mouse.up()
        wait_until(lambda: page.session.is_stopped, "the end of the work")
    page.hear({"ask": "reset"})
    wait_until(lambda: page.session.shown.scenario.rover == LSR1, "the loaded rover")
    wait_for_rest(page)


def test_a_click_into_the_scene_sets_the_goal_and_one_into_the_sky_is_refused(visitor, page):
    goal = page.session.wanted.goal
    visitor.tab.frame_locator("#scene").locator("canvas").first.wait_for()
    box = visitor.tab.locator("#scene").bounding_box()
    middle = box["x"] + 0.5 * box["width"], box["y"] + 0.7 * box["height"]
    client = wait_for_scene(page)
    ask(page, lambda: page._look(client, "Fit"))
    visitor.tab.wait_for_timeout(500)
    visitor.tab.mouse.click(*middle)
    wait_until(lambda: page.session.wanted.goal != goal, "another goal")
    assert max(map(abs, page.session.wanted.goal[:2])) < 4.0
    wait_for_rest(page)
    up = SimpleNamespace(ray_origin=(0.0, 0.0, 2.0), ray_direction=(0.0, 0.0, 1.0))
    page._request_click(up, shift=False)
    visitor.wait_for("refused: the click is beside the known ground")


def test_a_layer_colours_the_ground_and_a_soil_lets_wheels_sink(visitor, page):
    visitor.open_tab("Ground")
    visitor.choose("Colour by", "use of tilt")
    visitor.wait_for("beyond the limit")
    visitor.choose("Soil", "dry_sand")
    wait_until(lambda: page.session.shown.verdict.max_sinkage > 0.0, "wheels that sink")
    visitor.choose("Soil", "")
    wait_until(lambda: page.session.shown.scenario.options.model.soil is None, "hard ground")
    wait_for_rest(page)


def show_a_refusal(page):
    """Show a refused path of a changed rover 2 s after its start; return what is shown."""
    session = page.session
    changed = replace(page.home, rover=replace(LSR1, friction=0.6))
    ask(page, lambda: session.take_scenario(changed))
    wait_for_rest(page)
    ask(page, lambda: session.show_path(find_refused(page)))
    ask(page, lambda: page.playback.go_to(2.0))
    wait_for_rest(page)
    return session.shown


def test_a_link_brings_back_rover_path_and_time(visitor, page):
    session, shown, at = page.session, show_a_refusal(page), page.playback.time
    visitor.open_tab("Share")
    visitor.press("Link to what is shown")
    address = visitor.tab.get_attribute("#link", "href")
    assert address.startswith(f"{page.url}/?{KEY}=")
    ask(page, lambda: session.take_change(session.wanted.as_loaded()))
    ask(page, lambda: session.plan_to(np.array([0.5, 0.5])))
    wait_for_rest(page)
    visitor.tab.goto(address)
    wait_until(lambda: page.playback.time == pytest.approx(at, abs=1e-3), "the time")
    assert session.shown.scenario.rover.friction == 0.6
    np.testing.assert_array_equal(session.shown.path.poses, shown.path.poses)


@pytest.mark.long
def test_a_saved_file_shows_the_same_without_a_network(visitor, page, browser, tmp_path):
    shown = show_a_refusal(page)
    visitor.open_tab("Share")
    with visitor.tab.expect_download() as download:
        visitor.press("Save as HTML file")
    download.value.save_as(tmp_path / "refusal.html")
    context = browser.new_context(viewport=LAPTOP, offline=True, device_scale_factor=SCALE)
    tab = context.new_page()
    tab.set_default_timeout(1000.0 * WAIT)
    tab.goto((tmp_path / "refusal.html").as_uri())
    canvas = tab.frame_locator("#scene").locator("canvas").first
    canvas.wait_for()
    text = tab.inner_text("body")
    for word in ("not traversable", NAME, shown.verdict.reason, "rover_planner ", f"{page.url}/?"):
        assert word in text, word
    assert tab.locator("#wheels tr:nth-child(2) td").count() == 6
    assert tab.locator(".lane .broken").count() > 0 and tab.locator(".plot path").count() > 5

    def contrast() -> float:
        colours = np.asarray(Image.open(BytesIO(canvas.screenshot())))
        return float(colours[..., :3].reshape(-1, 3).std(axis=0).max())

    wait_until(lambda: contrast() > 20.0, "a scene, not one colour")
    context.close()


def test_letters_are_large_enough_and_have_contrast_and_a_phone_shows_all_of_its_width(visitor):
    found = visitor.tab.evaluate(READ_LETTERS)
    assert min(one["size"] for one in found) >= 12.0
    poor = [one for one in found if one["contrast"] < 4.5]
    assert not poor, poor[:5]
    visitor.tab.set_viewport_size({"width": 390, "height": 844})
    for selector in ("#stage", "#verdict", "#limits"):
        assert visitor.tab.locator(selector).bounding_box()["width"] > 350, selector
    visitor.tab.set_viewport_size(LAPTOP)


def test_a_visitor_of_a_page_that_ends_is_told_and_all_that_is_old_is_grey(visitor, page):
    assert "No connection" not in visitor.text("#errors")
    page.close()  # this is the last test of the page
    visitor.wait_for("No connection to the program")
    assert "grayscale" in visitor.tab.locator("main").evaluate("it => getComputedStyle(it).filter")
