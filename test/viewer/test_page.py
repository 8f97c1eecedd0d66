# SPDX-License-Identifier: Apache-2.0
"""The page in a real browser: its layout, the drive, the camera, clicks, links and files."""

import itertools
import re
import time
from collections.abc import Callable
from dataclasses import replace
from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from rover_physics.rover.rover_file import load_rover
from rover_planner.viewer.scene.scene import find_radius
from support.viewer.browser import LAPTOP, OVERLAPS, WAIT, Visitor, needs_browser, wait_until
from support.viewer.sessions import LSR1, ask, wait_for_rest
from support.viewer.visits import find_camera, look_from

pytestmark = [needs_browser, pytest.mark.slow]

MIDDLE = (720, 420)
"""A point of the screen on the ground, beside the notices of viser [px]."""

IN_SIGHT = """e => {
    const {left, right, top, bottom} = e.getBoundingClientRect();
    const seen = (x, y) => {
        const at = document.elementFromPoint(x, y);
        return at !== null && (e.contains(at) || at.contains(e));
    };
    return [top + 4, bottom - 4].every((y) => seen((left + right) / 2, y));
}"""
"""Returns whether the upper and the lower edge of an element are on the screen, not hidden."""

HIDDEN = """() => {
    const covers = [...document.querySelectorAll('#header, #hint')].map(
        e => e.getBoundingClientRect()).filter(e => e.width > 0);
    const boxes = [...document.querySelectorAll('.label-box')].filter(e => e.offsetParent);
    return [boxes.length, boxes.filter(box => {
        const p = box.getBoundingClientRect();
        return p.bottom < 0 || covers.some(q => p.left < q.right && q.left < p.right
            && p.top < q.bottom && q.top < p.bottom);
    }).map(box => box.textContent)];
}"""
"""How many labels there are, and which are behind the header or the hint, or above the window."""


@pytest.fixture
def slowly(page, monkeypatch) -> None:
    """The drive takes 100 s, so that it is not over before the browser has shown it."""
    monkeypatch.setattr(page.playback, "speed", 1.0)


def show_refused(page) -> None:
    """Show the first path that is refused, judged under all policies."""
    verdicts = [candidate.verdict for candidate in page.session.shown.candidates]
    index = next(k for k, verdict in enumerate(verdicts) if not verdict.traversable)
    ask(page, lambda: page.session.show_candidate(index))
    wait_for_rest(page)
    assert page.session.shown.index == index


# Layout.


def assert_seen(visitor: Visitor) -> None:
    """Assert that nothing of the drive tab is below the edge of the screen once it is drawn."""

    def is_seen(selector: str) -> bool:
        box = visitor.tab.locator(selector).bounding_box()
        return box is not None and box["y"] >= 0.0 and box["y"] + box["height"] <= 720.0

    for selector in ("#verdict:visible", "#dashboard", "#status", "#plots-legend"):
        wait_until(lambda selector=selector: is_seen(selector), f"{selector} in sight")


def test_the_page_opens_with_verdict_loads_and_header_on_the_screen_of_a_laptop(visitor, page):
    assert visitor.text("#verdict").startswith("traversable")
    dashboard = visitor.text("#dashboard")
    loads = [float(part.split()[-1]) for part in dashboard.split(" N")[:6]]
    assert sum(loads) == pytest.approx(LSR1.weight, rel=0.1)
    for name in ("Time", "Distance", "Energy", "Speed", "stability", "worst so far"):
        assert name in dashboard
    assert_seen(visitor)
    header = visitor.text("#header")
    for word in ("lsr1", "blocked.npz", "firm, friction 0.8", "equal torques", "planning"):
        assert word in header
    chips = [visitor.tab.locator(f'[data-chip="{name}"]') for name in ("is", "plays")]
    assert [chip.inner_text() for chip in chips] == ["traversable", "paused"]
    heights = [chip.bounding_box()["height"] for chip in chips]
    assert heights[0] == pytest.approx(heights[1], abs=1.0)
    show_refused(page)
    visitor.tab.get_by_role("button", name="Go to the failure").wait_for()
    assert_seen(visitor)  # the notice needs the most room


def are_apart(parts: list) -> bool:
    """Return whether parts of the page stand one above the other."""
    boxes = sorted((part.bounding_box() for part in parts), key=lambda box: box["y"])
    pairs = itertools.pairwise(boxes)
    return all(above["y"] + above["height"] <= below["y"] for above, below in pairs)


def test_in_windows_of_all_sizes_what_matters_is_seen_and_nothing_hides_another(page, browser):
    show_refused(page)
    visitor = Visitor(browser, page.url)
    canvas, header = visitor.tab.locator("canvas").first, visitor.tab.locator("#header")
    notice = visitor.tab.locator(".mantine-Notification-root").first

    def take_size(width: int, height: int) -> None:
        visitor.tab.set_viewport_size({"width": width, "height": height})

        def is_laid_out() -> bool:
            box = canvas.bounding_box()
            floats = box["x"] < 20.0
            fits = floats == (width < 1000) and (floats or box["x"] >= 250.0)
            return fits and box["width"] > 0.4 * width

        wait_until(is_laid_out, f"the panels and a wide scene, {width} px")

    notice.filter(has_text="Software WebGL").wait_for()
    for size in ((1280, 720), (900, 700)):
        take_size(*size)
        shown = [header, visitor.tab.locator("#hint"), notice]
        wait_until(lambda: are_apart(shown), f"header, hint and notice apart, {size}")  # noqa: B023
    visitor.hide_notices()
    for size in ((900, 700), (700, 700), (1600, 1000), (1280, 720)):
        take_size(*size)
        for name in ("#board", "#lanes"):
            part = visitor.tab.locator(name)
            wait_until(lambda part=part: part.evaluate(IN_SIGHT), f"all of {name}, {size}")

        def is_inside(width=size[0]) -> bool:
            box = header.bounding_box()
            return box["x"] >= 0.0 and box["x"] + box["width"] <= width

        wait_until(is_inside, "all of the header")
    failure = page.scene.frame.to_scene(page.judged.path.why.failure.state.position)
    for down in (0.9, 1.2):  # the failure is at the upper edge
        look_from(page, visitor, np.add(failure, [-2.5, 0.3, 0.6]), failure - [0.0, 0.0, down])
        wait_until(lambda: visitor.tab.evaluate(HIDDEN)[0] >= 3, "the labels")
        wait_until(lambda: visitor.tab.evaluate(HIDDEN)[1] == [], "labels beside the header")
    assert visitor.page_errors == []
    visitor.tab.close()
    wait_until(lambda: len(page.server.get_clients()) < 2, "the visitor to be gone")


def test_the_hint_for_first_visitors_can_be_closed_for_ever(visitor):
    hint = visitor.text("#hint")
    assert "Space" in hint and "goal" in hint
    visitor.show_scene()
    visitor.press("Got it")
    visitor.tab.locator("#hint").wait_for(state="hidden")
    canvas = visitor.tab.locator("canvas").first
    for width, floats in ((900, True), (LAPTOP["width"], False)):  # the panels are made anew
        visitor.tab.set_viewport_size({"width": width, "height": LAPTOP["height"]})
        wait_until(lambda f=floats: (canvas.bounding_box()["x"] < 20.0) == f, "the panels")
        assert not visitor.tab.locator("#hint").is_visible()
    visitor.tab.reload()
    visitor.tab.wait_for_selector("#dashboard")
    visitor.tab.wait_for_selector("#hint", state="attached")
    visitor.tab.locator("#hint").wait_for(state="hidden")


def test_a_failing_page_shows_a_red_banner_over_the_scene_and_goes_on(onlooker, page, monkeypatch):
    def fail(*_arguments) -> None:
        raise ValueError("no picture today")

    with monkeypatch.context() as patch:
        patch.setattr(page, "add_due_requests", fail)
        banner = onlooker.tab.locator("#errors")
        banner.wait_for()
        assert "stopped: ValueError: no picture today" in banner.inner_text().replace("\n", " ")
        style = banner.evaluate(
            "e => [getComputedStyle(e).backgroundColor, getComputedStyle(e).color]"
        )
        assert style == ["rgb(176, 0, 32)", "rgb(255, 255, 255)"]
        scene, box = onlooker.tab.locator("canvas").first.bounding_box(), banner.bounding_box()
        assert scene["x"] <= box["x"] and box["y"] + box["height"] < scene["height"]
        assert banner.evaluate(
            "e => { const b = e.getBoundingClientRect();"
            "e.style.pointerEvents = 'auto';"
            "const top = document.elementFromPoint(b.x + b.width / 2, b.y + b.height / 2);"
            "return e.contains(top); }"
        )
    banner.wait_for(state="detached")
    onlooker.press("Play")
    wait_until(lambda: page.playback.time > 0.0, "the rover to drive")


# The drive.


def test_buttons_play_pause_step_and_go_back_and_the_picture_follows(onlooker, page, slowly):
    before, group = onlooker.picture(), onlooker.buttons("Playback")
    wait_until(lambda: group() == ["Rewind", "Play", "Fast forward"], "the buttons at rest")
    onlooker.press("Play")
    wait_until(lambda: group() == ["Rewind", "Pause", "Fast forward"], "the other name")
    wait_until(lambda: onlooker.number("Distance") > 5.0, "the rover to drive")
    onlooker.press("Pause")
    onlooker.wait_for("paused")
    wait_until(lambda: group() == ["Rewind", "Play", "Fast forward"], "its first name")
    stopped = page.playback.time
    assert 0.0 < stopped < page.playback.duration
    wait_until(lambda: onlooker.number("Time") == pytest.approx(stopped, abs=0.1), "the board")
    wait_until(lambda: onlooker.picture() != before, "the rover elsewhere")
    assert page.playback.time == stopped
    onlooker.shrink_scene()
    onlooker.press("Fast forward")
    onlooker.wait_for("fast forward, 4 times as fast")
    onlooker.press("Rewind")
    onlooker.wait_for("rewinding")
    page.playback.speed = 10.0
    wait_until(lambda: page.playback.time == 0.0, "the start")
    times = page.session.shown.trajectory.times
    for press, row in (("Step", 1), ("Step", 2), ("Step back", 1)):
        onlooker.press(press)
        there = times[row]
        wait_until(lambda there=there: page.playback.time == pytest.approx(there), f"row {row}")
    wait_until(lambda: onlooker.number("Time") == pytest.approx(there, abs=0.06), "the board")


def test_every_typed_time_takes_effect_although_the_page_moves_the_scrubber_too(visitor, page):
    wait_until(lambda: visitor.tab.locator(".uplot canvas").count() == 3, "the plots")
    for typed in ("50", "50", "7.5", "61.2"):
        visitor.set_slider("Time [s]", typed)
        wait_until(lambda typed=typed: page.playback.time == float(typed), f"{typed} s")
        wait_until(lambda typed=typed: visitor.number("Time") == float(typed), "the board")
        distance = page.session.shown.trajectory.state_at(float(typed)).distance
        assert visitor.number("Distance") == pytest.approx(100.0 * distance, abs=0.2)
        plot = page.plots.plots["wheel_loads"]
        wait_until(
            lambda plot=plot, at=distance: np.any(np.isclose(plot.data[0], at)), "the cursor"
        )
        visitor.press("To the start")
        wait_until(lambda: visitor.slider_value("Time [s]") == 0.0, "the start")


def test_a_time_typed_while_it_plays_is_not_overwritten_and_counts_on_enter(visitor, page, slowly):
    ask(page, lambda: page.playback.go_to(50.0))
    visitor.press("Play")
    box = visitor.row("Time [s]").locator("input").last
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
    visitor.press("Pause")
    end = page.playback.time
    wait_until(lambda: float(box.input_value()) == pytest.approx(end, abs=0.06), "the end")


def test_a_time_typed_just_before_the_page_moves_the_scrubber_takes_effect(visitor, page):
    scrubber = page.drive_tab._controls._scrubber

    def show_late(typed: float) -> None:
        """Keep the page's thread busy until the visitor's time has come."""
        ready.append(typed)
        end = time.monotonic() + WAIT
        while scrubber.value != typed and time.monotonic() < end:
            pass
        page.drive_tab.move_scrubber()

    for typed in (1.0, 2.0, 3.0):
        ready: list[float] = []
        wait_until(lambda: page.drive_tab._held_until is None, "the last time to be shown")
        page.requests.add(lambda typed=typed: show_late(typed))
        wait_until(lambda ready=ready: ready, "the page's thread")
        visitor.set_slider("Time [s]", f"{typed:g}")
        wait_until(lambda typed=typed: page.playback.time == typed, f"{typed} s")
        wait_until(lambda typed=typed: visitor.slider_value("Time [s]") == typed, "the box")


def test_space_plays_and_pauses_and_arrows_step_wherever_the_focus_was(visitor, page, slowly):
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
    visitor.type_keys("friction [-]", "0.5", "ArrowLeft")
    assert page.playback.rate == 0.0
    keyboard.press("Escape")


def test_a_click_on_lanes_or_plots_goes_there(visitor, page):
    trajectory = page.session.shown.trajectory
    visitor.open_tab("Rover")  # the scrubber need not be in sight
    for curves, share in (("#lanes svg", 0.5), (".u-over >> nth=1", 0.25)):
        box = visitor.tab.locator(curves).bounding_box()
        visitor.tab.mouse.click(box["x"] + share * box["width"], box["y"] + 0.5 * box["height"])
        there = pytest.approx(share * trajectory.distance[-1], abs=0.03)

        def distance() -> float:
            return float(np.interp(page.playback.time, trajectory.times, trajectory.distance))

        wait_until(lambda there=there: distance() == there, f"{share} of the path")


# The scene.


def test_the_camera_looks_from_above_from_the_side_and_goes_along(visitor, page):
    camera = find_camera(page)
    path = page.path_to_look_at()
    middle = 0.5 * (path.min(axis=0) + path.max(axis=0))

    def look(name: str, fits: Callable[[np.ndarray, np.ndarray], bool]) -> np.ndarray:
        """Press a button, and return the direction of the view that fits."""

        def offset() -> list[np.ndarray]:
            at, away = np.array(camera.look_at), np.subtract(camera.position, camera.look_at)
            return [away] if fits(at, away) else []

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
    visitor.press("Play")
    wait_until(lambda: np.array(camera.look_at)[0] > rover[0] + 0.5, "the camera to go along")
    visitor.press("Stay")
    visitor.wait_for("Follow")
    ask(page, lambda: page._load(lambda: load_rover("m2020")))  # 3 times as large
    away = np.linalg.norm(fit) + find_radius(load_rover("m2020")) / 2
    wait_until(
        lambda: np.linalg.norm(np.subtract(camera.position, camera.look_at)) > away,
        "the camera to leave the inside of the large rover",
    )


def test_clicks_set_goal_and_start_and_one_into_the_sky_is_refused_in_every_tab(onlooker, page):
    session, (start, goal) = (
        page.session,
        (page.session.scenario.start, page.session.scenario.goal),
    )
    onlooker.click_scene(*MIDDLE)
    wait_until(lambda: session.scenario.goal != goal, "another goal")
    x, y, _ = session.scenario.goal
    assert abs(x) < 4.0 and abs(y) < 4.0 and session.scenario.start == start
    wait_until(lambda: "candidate paths" in onlooker.text("#details"), "all candidates")
    wait_for_rest(page)
    goal = session.scenario.goal
    onlooker.click_scene(MIDDLE[0] - 60, MIDDLE[1], shift=True)
    wait_until(lambda: session.scenario.start != start, "another start")
    assert session.scenario.goal[:2] == goal[:2]
    onlooker.open_tab("Ground and path")
    onlooker.click_scene(600, 100)  # the sky
    onlooker.wait_for("refused: the click is beside the known ground")
    onlooker.click_scene(*MIDDLE)
    onlooker.tab.locator("#refusal").wait_for(state="hidden")


def test_a_goal_behind_a_wall_is_refused_with_its_reason_and_shows_what_was_searched(
    onlooker, page
):
    before = onlooker.picture()
    ask(page, lambda: page.plan(np.array([3.35, 0.0])))
    onlooker.wait_for("not traversable")
    wait_for_rest(page)
    assert not page.session.shown.answer.traversable
    headline, reason = page.judged.path.why.failure.headline, page.session.shown.verdict.reason
    wait_until(lambda: headline in onlooker.text("#verdict"), "the broken limit")
    wait_until(lambda: reason in onlooker.text("#details"), "the reason")
    wait_until(lambda: onlooker.picture() != before, "ghosts in the scene")
    onlooker.open_tab("Ground and path")
    before = onlooker.steady_picture()
    onlooker.tab.get_by_label("What was searched").check()
    wait_until(lambda: onlooker.picture() != before, "what was searched")
    onlooker.tab.get_by_label("What was searched").uncheck()


# What is sent to others.


def test_a_link_shows_the_same_again(visitor, page):
    session = page.session
    visitor.open_tab("Rover")
    visitor.set_slider("friction [-]", "0.6")
    wait_until(lambda: session.wanted.rover.friction == 0.6, "the friction")
    wait_for_rest(page)
    ask(page, lambda: session.show_candidate(2))
    wait_for_rest(page)
    ask(page, lambda: page.playback.go_to(2.0))
    ask(page, lambda: page.ground_tab.choose_layer("slope", 0.0))
    poses = session.shown.candidate.poses
    visitor.open_tab("Share")
    visitor.press("Link to what is shown")
    visitor.tab.wait_for_selector("#link")
    query = visitor.tab.get_attribute("#link", "href")
    visitor.tab.wait_for_function("() => location.search.length > 20")
    assert "path=3" in query and "time=2.0" in query and "layer=slope" in query

    def change() -> None:
        page._load(lambda: replace(LSR1, nominal_speed=0.05))  # another rover of the same name
        page.plan(np.array([0.5, 0.5]))
        page.ground_tab.choose_layer("height", 0.0)

    ask(page, change)
    wait_for_rest(page)
    visitor.tab.reload()  # the address bar has the link
    wait_until(lambda: session.rover == replace(LSR1, friction=0.6), "the friction")
    wait_until(lambda: session.shown.index == 2, "the path")
    wait_until(lambda: page.playback.time == 2.0, "the time")
    np.testing.assert_array_equal(session.shown.candidate.poses, poses)
    assert page.ground_tab.layer == "slope"
    wait_until(lambda: visitor.number("Time") == 2.0, "the board")
    visitor.tab.evaluate("history.replaceState(null, '', '?')")
    ask(page, lambda: page.ground_tab.choose_layer("height", 0.0))


def test_a_refusal_is_sent_as_one_file_with_scene_pose_numbers_and_versions(
    visitor, page, browser, tmp_path
):
    show_refused(page)
    visitor.wait_for("not traversable")
    file = tmp_path / "refusal.html"
    visitor.open_tab("Share")
    with visitor.tab.expect_download() as download:
        visitor.press("Save as HTML file")
    download.value.save_as(file)
    reason, verdict = page.session.shown.reason, page.session.shown.verdict
    context = browser.new_context(viewport=LAPTOP, offline=True, device_scale_factor=0.4)
    tab = context.new_page()
    errors: list[str] = []
    tab.on("pageerror", lambda error: errors.append(str(error)))
    tab.set_default_timeout(1000.0 * WAIT)
    tab.goto(file.as_uri())
    tab.wait_for_selector("canvas")
    report = tab.inner_text("#report")
    assert reason in report and "not traversable" in report
    for word in ("lsr1", "blocked.npz", "refused at", "rover_planner ", "numpy ", "map="):
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
