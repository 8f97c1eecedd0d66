"""A visit in a real browser: banner, boxes, arm, header, keys, camera, narrow windows, files."""

import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from rover_physics.rover.rover_file import load_rover
from rover_planner.planning.path_query import PathQueryOptions
from rover_planner.planning.ways.way_search import LatticeSettings
from rover_planner.studies.rover_values import RoverValue, write_rover
from rover_planner.viewer.browser.link import read_link, write_link
from rover_planner.viewer.pages.page import Page
from rover_planner.viewer.scene.scene import find_radius
from rover_planner.viewer.state.session import ViewSession
from support.grounds import make_terrain
from support.viewer.browser import LAPTOP, OVERLAPS, WAIT, Visitor, needs_browser, wait_until
from support.viewer.sessions import LSR1, ramp
from support.viewer.visits import find_camera, open_browser, wait_for_browser, wait_for_rest

pytestmark = [needs_browser, pytest.mark.slow]

FRICTION, COM = "friction [-]", "body centre x [m]"


@pytest.fixture(scope="module")
def browser() -> Iterator[object]:
    with open_browser() as chromium:
        yield chromium


@pytest.fixture(scope="module")
def page() -> Iterator[Page]:
    options, search = PathQueryOptions(count=3, spacing=0.5), LatticeSettings(budget=0.1)
    ends = (-2.0, 0.0, 0.0), (1.0, 0.0, 0.0)
    session = ViewSession(LSR1, make_terrain(ramp), *ends, options, search)
    session.ground_name = "ramp.npz"
    served = Page(session, port=0)
    yield served
    served.close()


@pytest.fixture(scope="module")
def opened(page, browser) -> Visitor:
    visitor = Visitor(browser, page.url)
    visitor.tab.add_style_tag(content=".mantine-Notifications-root { display: none; }")
    return visitor


@pytest.fixture
def visitor(opened, page) -> Visitor:
    """A visitor of the page at rest, with the preset lsr1, paused at the start."""
    done: list[bool] = []

    def reset() -> None:
        page.playback.go_to(0.0)
        page._load(lambda: LSR1)
        page.session.change_options(policy="equal")
        done.append(True)

    page.requests.add(reset)
    wait_until(lambda: done, "the reset")
    wait_for_rest(page)
    wait_for_browser(page, opened)
    opened.open_tab("Drive")
    opened.wait_for("paused")
    return opened


def follow_values(page: Page, monkeypatch) -> list[float]:
    """Return a list that gets all values that the page applies from now on."""
    applied: list[float] = []
    change = page.session.change_rover

    def note(keys, value):
        applied.append(value)
        return change(keys, value)

    monkeypatch.setattr(page.session, "change_rover", note)
    return applied


def test_a_typed_number_counts_on_enter_and_not_at_each_key(visitor, page, monkeypatch):
    applied = follow_values(page, monkeypatch)
    visitor.open_tab("Rover")
    visitor.type_keys(FRICTION, "0.55")
    visitor.tab.wait_for_timeout(400)
    assert applied == [] and page.session.wanted.rover.friction == LSR1.friction
    visitor.tab.keyboard.press("Enter")
    wait_until(lambda: applied, "the value")
    wait_for_rest(page)
    assert applied == [0.55] and page.session.rover.friction == 0.55


def test_negative_decimals_can_be_typed_and_count_when_the_box_is_left(visitor, page, monkeypatch):
    applied = follow_values(page, monkeypatch)
    visitor.open_tab("Rover")
    visitor.press("Masses")
    visitor.type_keys(COM, "-0.05", "Tab")
    wait_until(lambda: applied, "the value")
    wait_for_rest(page)
    assert applied == [-0.05]
    assert page.session.rover.masses.body.com[0] == -0.05
    assert visitor.slider_value(COM) == -0.05


def test_escape_an_empty_box_and_numbers_beyond_the_slider(visitor, page, monkeypatch):
    applied = follow_values(page, monkeypatch)
    visitor.open_tab("Rover")
    for text, end in (("0.3", "Escape"), ("", "Enter")):
        visitor.type_keys(FRICTION, text, end)
        visitor.tab.wait_for_timeout(300)
        assert applied == [] and visitor.slider_value(FRICTION) == LSR1.friction
    note_shown = visitor.record_note()
    visitor.type_keys(FRICTION, "99", "Enter")
    wait_until(lambda: applied, "the value")
    assert applied == [2.0]  # the end of the slider
    wait_until(lambda: visitor.slider_value(FRICTION) == 2.0, "the box to show it")
    note = visitor.tab.locator("#limited")
    text, away = note_shown()  # it is at its box
    assert text == "limited to 2, the slider's largest value" and abs(away) < 20.0
    visitor.type_keys(FRICTION, "0.5", "Enter")
    wait_until(lambda: applied[-1] == 0.5, "a value within the range")
    note.wait_for(state="hidden")
    visitor.type_keys(FRICTION, "-1", "Enter")
    wait_until(lambda: applied[-1] == 0.16, "the smallest value")
    assert note.inner_text() == "limited to 0.16, the slider's smallest value"
    assert note.count() == 1


def test_the_arm_goes_with_its_rover_and_the_box_of_presets_follows_a_file(
    visitor, page, tmp_path
):
    visitor.open_tab("Rover")
    box = visitor._row("Preset").locator("input").first
    wait_until(lambda: box.input_value() == "lsr1", "the preset")
    armless = replace(load_rover("lsr1"), name="bare", manipulator=None)
    file = tmp_path / "bare.yaml"
    file.write_text(write_rover(armless))
    before = visitor.picture()
    with visitor.tab.expect_file_chooser() as chooser:
        visitor.press("Load a rover file")
    chooser.value.set_files(file)
    wait_until(lambda: page.session.rover.name == "bare", "the loaded rover")
    wait_until(lambda: box.input_value() == "bare (file)", "the box of presets")
    wait_until(lambda: visitor.picture() != before, "the other rover")
    nodes = page.server.scene._handle_from_node_name
    wait_until(lambda: "/rover/arm" not in nodes and "/rover/body" in nodes, "no arm")
    wait_until(lambda: "bare" in visitor.text("#header"), "the header")
    visitor.choose("Preset", "lsr1")
    wait_until(lambda: page.session.rover == LSR1, "the preset")
    wait_until(lambda: "/rover/arm" in nodes, "the arm")


def test_a_failing_page_shows_a_red_banner_over_the_scene_and_goes_on(visitor, page, monkeypatch):
    def fail(*_arguments) -> None:
        raise ValueError("no picture today")

    with monkeypatch.context() as patch:
        patch.setattr(page, "add_due_requests", fail)
        visitor.tab.wait_for_selector("#errors")
        banner = visitor.tab.locator("#errors")
        assert "stopped: ValueError: no picture today" in banner.inner_text().replace("\n", " ")
        style = banner.evaluate(
            "e => [getComputedStyle(e).backgroundColor, getComputedStyle(e).color]"
        )
        assert style == ["rgb(176, 0, 32)", "rgb(255, 255, 255)"]
        scene = visitor.tab.locator("canvas").first.bounding_box()
        box = banner.bounding_box()
        assert scene["x"] <= box["x"] and box["y"] + box["height"] < scene["height"]
        assert banner.evaluate(
            "e => { const b = e.getBoundingClientRect();"
            "e.style.pointerEvents = 'auto';"
            "const top = document.elementFromPoint(b.x + b.width / 2, b.y + b.height / 2);"
            "return e.contains(top); }"
        )
    visitor.tab.wait_for_selector("#errors", state="detached")
    visitor.press("Play")
    wait_until(lambda: page.playback.time > 0.0, "the rover to drive")


def test_the_header_tells_rover_map_soil_policy_mode_verdict_and_playback(visitor, page):
    chip = visitor.tab.locator('[data-chip="is"]')
    wait_until(lambda: chip.inner_text() == "traversable", "the verdict")
    header = visitor.text("#header")
    for word in ("lsr1", "ramp.npz", "firm, friction 0.8", "equal torques", "planning"):
        assert word in header
    assert visitor.tab.locator('[data-chip="plays"]').inner_text() == "paused"
    heights = [
        visitor.tab.locator(f'[data-chip="{name}"]').bounding_box()["height"]
        for name in ("is", "plays")
    ]
    assert heights[0] == pytest.approx(heights[1], abs=1.0)
    visitor.open_tab("Rover")
    visitor.set_slider(FRICTION, "0.7")
    wait_until(lambda: "firm, friction 0.7" in visitor.text("#header"), "the soil")
    assert "lsr1 (changed)" in visitor.text("#header")


def test_space_plays_and_pauses_and_arrows_step_wherever_the_focus_was(visitor, page, monkeypatch):
    monkeypatch.setattr(page.playback, "speed", 1.0)
    times = page.session.shown.trajectory.times
    visitor.press("Step")  # the button keeps no focus, so that space does not press it again
    wait_until(lambda: page.playback.time == pytest.approx(times[1]), "the first waypoint")
    keyboard = visitor.tab.keyboard
    visitor.tab.wait_for_function("() => document.activeElement === document.body")
    for key, row in (("ArrowRight", 2), ("ArrowRight", 3), ("ArrowLeft", 2)):
        keyboard.press(key)
        there = times[row]
        wait_until(lambda there=there: page.playback.time == pytest.approx(there), key)
    camera = find_camera(page)
    place = np.array(camera.position)
    keyboard.press("Space")
    wait_until(lambda: page.playback.rate == 1.0, "it to play")
    visitor.wait_for("Pause")
    keyboard.press("Space")
    wait_until(lambda: page.playback.rate == 0.0, "it to pause")
    np.testing.assert_allclose(camera.position, place)  # the arrows do not turn the camera
    visitor.open_tab("Rover")
    visitor.type_keys(FRICTION, "0.5", "ArrowLeft")
    assert page.playback.rate == 0.0
    keyboard.press("Escape")


@pytest.mark.parametrize(("curves", "share"), [("#lanes svg", 0.5), (".u-over >> nth=1", 0.25)])
def test_a_click_on_lanes_or_plots_goes_there(visitor, page, curves, share):
    trajectory = page.session.shown.trajectory
    visitor.open_tab("Rover")  # the scrubber need not be in sight
    area = visitor.tab.locator(curves).bounding_box()
    visitor.tab.mouse.click(area["x"] + share * area["width"], area["y"] + 0.5 * area["height"])
    there = share * trajectory.distance[-1]

    def distance() -> float:
        return float(np.interp(page.playback.time, trajectory.times, trajectory.distance))

    wait_until(lambda: distance() == pytest.approx(there, abs=0.03), f"{share} of the way")


def test_one_button_plays_and_pauses(visitor, page, monkeypatch):
    monkeypatch.setattr(page.playback, "speed", 1.0)
    group = visitor._buttons("Playback")
    assert group() == ["Rewind", "Play", "Fast forward"]
    visitor.press("Play")
    wait_until(lambda: group() == ["Rewind", "Pause", "Fast forward"], "the other name")
    visitor.press("Pause")
    wait_until(lambda: group() == ["Rewind", "Play", "Fast forward"], "its first name")
    assert page.playback.rate == 0.0


def test_the_camera_looks_from_above_from_the_side_and_goes_along(visitor, page):
    camera = find_camera(page)
    path = page.path_to_look_at()
    middle = 0.5 * (path.min(axis=0) + path.max(axis=0))

    def look(name: str, fits: Callable[[np.ndarray, np.ndarray], bool]) -> np.ndarray:
        """Press a button, and return the direction of the view that fits."""

        def offset() -> np.ndarray | None:
            at, away = np.array(camera.look_at), np.subtract(camera.position, camera.look_at)
            return [away] if fits(at, away) else None

        visitor.press(name)
        return wait_until(offset, f"the view {name}")[0]

    look("Top", lambda at, away: np.allclose(at[:2], middle, atol=0.05)
         and away[2] > 10.0 * np.hypot(away[0], away[1]))  # fmt: skip
    side = look("Side", lambda _, away: away[1] < -2.0 * max(abs(away[0]), away[2]))
    fit = look("Fit", lambda at, away: np.allclose(at[:2], middle, atol=0.05)
               and np.linalg.norm(away) > np.linalg.norm(side))  # fmt: skip
    visitor.press("Follow")
    visitor.wait_for("Stay")
    rover = page.scene._last_position
    wait_until(
        lambda: np.allclose(np.array(camera.look_at), page.scene.frame.to_scene(rover), atol=0.01),
        "the camera to look at the rover",
    )
    page.requests.add(lambda: page.playback.go_to(30.0))
    page.requests.add(lambda: setattr(page.drive_tab, "outdated", True))
    wait_until(lambda: np.array(camera.look_at)[0] > rover[0] + 0.5, "the camera to go along")
    visitor.press("Stay")
    visitor.wait_for("Follow")
    page.requests.add(lambda: page._load(lambda: load_rover("m2020")))  # 3 times as large
    away = np.linalg.norm(fit) + find_radius(load_rover("m2020")) / 2
    wait_until(
        lambda: np.linalg.norm(np.subtract(camera.position, camera.look_at)) > away,
        "the camera to leave the inside of the large rover",
    )


def test_the_hint_for_first_visitors_can_be_closed_for_ever(visitor):
    hint = visitor.text("#hint")
    assert "Space" in hint and "goal" in hint
    visitor.press("Got it")
    visitor.tab.locator("#hint").wait_for(state="hidden")
    for width in (500, 900, LAPTOP["width"]):  # each time the panels are made anew
        visitor.tab.set_viewport_size({"width": width, "height": LAPTOP["height"]})
        visitor.tab.wait_for_timeout(700)
        assert not visitor.tab.locator("#hint").is_visible()
    visitor.tab.reload()
    visitor.tab.wait_for_selector("#dashboard")
    visitor.tab.wait_for_selector("#hint", state="attached")
    visitor.tab.locator("#hint").wait_for(state="hidden")


def test_a_link_shows_the_same_again(visitor, page):
    visitor.open_tab("Rover")
    visitor.set_slider(FRICTION, "0.6")
    wait_until(lambda: page.session.wanted.rover.friction == 0.6, "the friction")
    wait_for_rest(page)
    page.requests.add(lambda: page._choose_path(2))
    wait_until(lambda: page.session.shown.index == 2, "the third path")
    wait_for_rest(page)
    page.requests.add(lambda: page.playback.go_to(20.0))
    page.requests.add(lambda: page.ground_tab.choose_layer("slope", 0.0))
    wait_until(lambda: page.playback.time == 20.0, "20 s")
    poses = page.session.shown.candidate.poses
    visitor.open_tab("Share")
    visitor.press("Link to what is shown")
    visitor.tab.wait_for_selector("#link")
    query = visitor.tab.get_attribute("#link", "href")
    visitor.tab.wait_for_function("() => location.search.length > 20")
    assert "path=3" in query and "time=20.0" in query and "layer=slope" in query

    def change() -> None:
        page._load(lambda: replace(LSR1, nominal_speed=0.05))  # another rover of the same name
        page.plan(np.array([0.5, 0.5]))
        page.ground_tab.choose_layer("height", 0.0)

    page.requests.add(change)
    wait_until(lambda: page.session.rover.nominal_speed == 0.05, "something else")
    wait_for_rest(page)
    other = page.sharing.make_link()
    visitor.tab.reload()  # the address bar has the link
    session = page.session
    wait_until(lambda: session.rover.friction == 0.6, "the friction")
    wait_until(lambda: session.shown.index == 2, "the path")
    wait_until(lambda: page.playback.time == 20.0, "the time")
    assert session.rover == replace(LSR1, friction=0.6)
    np.testing.assert_array_equal(session.shown.candidate.poses, poses)
    assert page.ground_tab.layer == "slope"
    wait_until(lambda: visitor.number("Time") == 20.0, "the dashboard")
    visitor.tab.evaluate("history.replaceState(null, '', '?')")
    page.requests.add(lambda: page.open_link(read_link(write_link(other))))
    wait_until(lambda: session.rover.nominal_speed == 0.05, "the rover of a file")
    assert visitor.page_errors == []


def test_a_link_to_another_map_is_refused(page):
    link = replace(page.sharing.make_link(), ground="00000000")
    page.requests.add(lambda: page.open_link(link))
    wait_until(lambda: "about another map" in page.session.refusal, "the refusal")


def test_a_refusal_is_sent_as_one_file_with_scene_pose_numbers_and_versions(
    visitor, page, browser, tmp_path
):
    page.requests.add(lambda: page._change_value(friction_value(page), 0.4))
    visitor.wait_for("not traversable")
    wait_for_rest(page)
    file = tmp_path / "refusal.html"
    visitor.open_tab("Share")
    with visitor.tab.expect_download() as download:
        visitor.press("Save as HTML file")
    download.value.save_as(file)
    reason, verdict = page.session.finished.reason, page.session.shown.verdict
    assert not verdict.traversable
    context = browser.new_context(viewport=LAPTOP, offline=True)
    tab = context.new_page()
    errors: list[str] = []
    tab.on("pageerror", lambda error: errors.append(str(error)))
    tab.goto(file.as_uri())
    tab.set_default_timeout(1000.0 * WAIT)
    tab.wait_for_selector("canvas")
    report = tab.inner_text("#report")
    assert reason in report and "not traversable" in report
    for word in ("lsr1", "ramp.npz", "refused at", "rover_planner ", "numpy ", "viser ", "map="):
        assert word in report
    assert re.search(rf"waypoint {verdict.first_failure}\b", report)
    tab.add_style_tag(content=".mantine-Notifications-root, #report { display: none; }")

    def contrast() -> float:
        colours = np.asarray(Image.open(BytesIO(tab.locator("canvas").first.screenshot())))
        return float(colours[..., :3].reshape(-1, 3).std(axis=0).max())

    wait_until(lambda: contrast() > 20.0, "a scene, not one colour")
    labels = page.scene.labels._all()
    assert len(labels) > 3
    wait_until(lambda: tab.evaluate(OVERLAPS) == [len(labels), []], "the labels, apart")
    assert errors == []
    context.close()


def friction_value(page: Page) -> RoverValue:
    """Return the number of the rover that the slider of the friction changes."""
    values = page.rover_tab._sliders._sliders
    return next(value for value in values if value.label == FRICTION)
