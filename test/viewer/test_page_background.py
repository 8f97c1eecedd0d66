"""The page in a real browser: alive while it judges, right after sliders are dragged."""

from collections.abc import Iterator

import pytest

from rover_physics.traversability.judge import judge_path
from rover_planner.planning.ways.way_search import LatticeSettings
from rover_planner.viewer.pages.page import Page
from rover_planner.viewer.state.session import ViewSession
from support.viewer.browser import Visitor, needs_browser, wait_until
from support.viewer.sessions import (
    GOAL,
    START,
    held,
    lowered_reef,
    slow_options,
    tolerant_rover,
)
from support.viewer.visits import open_browser, wait_for_rest
from support.waiting import start_watch

pytestmark = [needs_browser, pytest.mark.slow]

FRICTION = "friction [-]"
MAX_PAUSE = 1.0
"""Longest pause of the playback [s]; without the judgement in its way it is 0.1 s."""


@pytest.fixture(scope="module")
def browser() -> Iterator[object]:
    with open_browser() as chromium:
        yield chromium


@pytest.fixture(scope="module")
def slow_page() -> Iterator[Page]:
    """A page on a reef that needs seconds for each change; a search for a way ends soon."""
    ground, options = lowered_reef(), slow_options(2, 1e-4)
    hurried = LatticeSettings(budget=0.1)
    session = ViewSession(tolerant_rover(), ground, START, GOAL, options, hurried)
    page = Page(session, port=0)
    yield page
    page.close()


@pytest.fixture(scope="module")
def opened(slow_page, browser) -> Visitor:
    return Visitor(browser, slow_page.url)


@pytest.fixture
def visitor(opened, slow_page) -> Visitor:
    """A visitor of a page that is up to date, with the tab of the rover."""
    if slow_page.session.is_stopped:
        slow_page.requests.add(slow_page._judge_again)
    wait_for_rest(slow_page)
    opened.tab.wait_for_selector("#judging", state="hidden")
    opened.open_tab("Rover")
    return opened


def longest_pause(page: Page, until) -> float:
    """Return the longest time for which the playback stood still before a condition held [s].

    A time in which the machine stood still does not count.
    """
    longest, last, paused = 0.0, page.playback.time, start_watch()

    def watch() -> bool:
        nonlocal longest, last, paused
        if page.playback.time != last:
            last, paused = page.playback.time, start_watch()
        longest = max(longest, paused())
        return until()

    wait_until(watch, "the condition")
    return longest


def is_judged(page: Page) -> bool:
    """Return whether all that is wanted is judged, the path by itself and then all candidates."""
    session = page.session
    return session.finished.answered is session.wanted and session.progress is None


def test_while_a_change_is_judged_the_page_says_so_and_the_rover_drives_on(visitor, slow_page):
    session = slow_page.session
    before, shown = session.wanted, session.shown
    slow_page.playback.speed = 1.0
    slow_page.requests.add(slow_page.playback.play)
    with held(session._background):
        visitor.set_slider(FRICTION, "1.9")
        visitor.tab.wait_for_selector("#judging")
        visitor.wait_for("judging path")
        assert session.wanted is not before and session.progress is not None
        assert session.shown is shown
        then = slow_page.playback.time
        wait_until(lambda: slow_page.playback.time > then, "the rover to drive on")
    pause = longest_pause(slow_page, lambda: is_judged(slow_page))
    assert session.rover.friction == 1.9 and session.shown is not shown
    assert pause < MAX_PAUSE
    slow_page.requests.add(slow_page.playback.pause)
    visitor.tab.wait_for_selector("#judging", state="hidden")


def test_the_old_verdict_is_greyed_until_the_new_one_is_there(visitor, slow_page):
    with held(slow_page.session._background):
        visitor.set_slider(FRICTION, "1.8")
        grey = set(range(len(slow_page.session.candidates)))
        wait_until(lambda: slow_page.scene.paths._old == grey, "grey paths")
        visitor.wait_for("old values: judging")
    wait_for_rest(slow_page)
    visitor.tab.locator("#old").first.wait_for(state="detached")
    wait_until(lambda: slow_page.scene.paths._old == set(), "coloured paths")


@pytest.mark.long
def test_camera_and_second_visitor_are_served_while_a_change_is_judged(
    visitor, slow_page, browser
):
    second = Visitor(browser, slow_page.url)
    picture = visitor.picture()
    with held(slow_page.session._background):
        visitor.set_slider(FRICTION, "1.7")
        visitor.tab.mouse.move(600, 420)
        visitor.tab.mouse.down()
        visitor.tab.mouse.move(700, 420, steps=4)
        visitor.tab.mouse.up()
        wait_until(lambda: visitor.picture() != picture, "the camera to turn")
        for told in (visitor, second):
            told.wait_for("judging path")
    wait_for_rest(slow_page)
    second.tab.wait_for_selector("#judging", state="hidden")
    assert second.page_errors == visitor.page_errors == []
    second.tab.close()


def test_a_cancelled_judgement_leaves_the_old_verdict_and_can_be_begun_again(visitor, slow_page):
    session = slow_page.session
    friction, shown = session.rover.friction, session.shown
    with held(session._background):
        visitor.set_slider(FRICTION, "1.6")
        visitor.press("Cancel")
        wait_until(lambda: session.is_stopped, "the end of the work")
    visitor.wait_for("Judge again")
    assert session.rover.friction == friction and session.shown is shown
    visitor.wait_for("old values: the judgement was stopped")
    assert visitor.slider_value(FRICTION) == session.wanted.rover.friction == 1.6
    visitor.press("Judge again")
    wait_for_rest(slow_page)
    assert session.rover.friction == 1.6
    visitor.tab.locator("#old").first.wait_for(state="detached")


@pytest.mark.long
def test_sliders_dragged_to_both_ends_leave_the_page_alive_and_right(visitor, slow_page):
    session = slow_page.session
    for label, end in ((FRICTION, 1.0), (FRICTION, 0.0), ("front wheel x [m]", 1.0)):
        before = session.wanted
        visitor.tab.wait_for_selector("#judging", state="hidden")  # it moves the sliders
        visitor.drag_slider(label, end)
        wait_until(lambda before=before: session.wanted is not before, "the slider")
        wait_for_rest(slow_page)
        poses, options = session.shown.candidate.poses, session.sweep_options()
        _, verdict = judge_path(session.rover, session.terrain, poses, options)
        assert session.shown.verdict.traversable == verdict.traversable
        assert session.shown.verdict.reason == verdict.reason
        word = "traversable" if verdict.traversable else "not traversable"
        wait_until(
            lambda word=word: visitor.text("#verdict:visible").startswith(word), "the verdict"
        )
        assert verdict.reason in visitor.text("#verdict:visible")
    assert visitor.slider_value(FRICTION) == session.rover.friction
    assert not slow_page.errors.messages and visitor.page_errors == []
