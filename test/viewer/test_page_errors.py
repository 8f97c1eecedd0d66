# SPDX-License-Identifier: Apache-2.0
"""Errors on the page: it shows what failed and why, and goes on."""

import threading
import time

import numpy as np
import pytest

from support.viewer.sessions import PATIENCE, ask, ramp, session_on, wait_for_rest
from support.waiting import wait_until as wait

pytest.importorskip("viser", reason="no viser: pip install '.[view]'")

import viser

from rover_planner.viewer.live.listener import LiveListener
from rover_planner.viewer.pages.live_page import LivePage
from rover_planner.viewer.pages.page import Page
from rover_planner.viewer.scene.labels import Labels
from rover_planner.viewer.scene.local_frame import LocalFrame
from rover_planner.viewer.scene.overlays import PathOverlay
from rover_planner.viewer.state.colours import REFUSED

pytestmark = pytest.mark.filterwarnings("error::pytest.PytestUnhandledThreadExceptionWarning")


def wait_until(condition, what: str) -> None:
    """Wait for what a busy machine's page does late."""
    wait(condition, what, PATIENCE)


@pytest.fixture
def page():
    """A page without visitors."""
    served = Page(session_on(ramp), port=0)
    wait_for_rest(served)
    yield served
    served.close()


def shown_errors(page) -> str:
    """Return the notice of errors as HTML, empty if it is hidden."""
    return page.errors._box.content if page.errors._box.visible else ""


def fail(*_arguments) -> None:
    raise ValueError("a line of <no> points")


@pytest.fixture
def server():
    server = viser.ViserServer(port=0, verbose=False)
    yield server
    server.stop()


def test_a_shown_path_that_a_change_of_the_rover_makes_impassable_is_drawn(server):
    session = session_on(ramp)
    assert session.shown.verdict.traversable
    assert session.change_rover([("friction",)], 0.4)
    assert not session.shown.verdict.traversable
    overlay = PathOverlay(server.scene, Labels(server.scene), LocalFrame())
    overlay.show(session.rover, session.terrain, session.shown.candidates, session.shown.index)
    driven, beyond, *cross = overlay.ribbons[session.shown.index].strands
    assert driven.colour == REFUSED and driven.width > beyond.width
    np.testing.assert_array_equal(driven.line[-1], beyond.line[0])
    assert beyond.colour != REFUSED and len(cross) == 2


@pytest.mark.parametrize("index", [0, 2])
def test_a_path_that_is_judged_again_replaces_its_own_candidate(index):
    session = session_on(ramp)
    session.show_candidate(index)
    session.change_rover([("friction",)], 0.4)
    assert len(session.shown.candidates) == len(session.shown.answer.candidates)
    assert session.shown.candidates[index] is session.shown.candidate
    np.testing.assert_array_equal(
        session.shown.candidates[index].poses, session.shown.answer.candidates[index].poses
    )
    traversable = [candidate.verdict.traversable for candidate in session.shown.candidates]
    assert traversable == [k != index for k in range(len(traversable))]


def test_a_failed_request_is_shown_until_a_request_succeeds(page):
    ask(page, fail)
    wait_until(lambda: shown_errors(page), "the notice")
    assert "the last request failed" in shown_errors(page)
    assert "ValueError: a line of &lt;no&gt; points" in shown_errors(page)
    ask(page, lambda: page.playback.seek(1.0))
    wait_until(lambda: not shown_errors(page), "the notice to go")


def test_the_verdict_is_right_and_the_rover_drives_if_the_paths_cannot_be_drawn(page, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(page.scene.paths, "show", fail)
        ask(page, lambda: page.session.change_rover([("friction",)], 0.4))
        wait_until(lambda: "the paths are not drawn" in shown_errors(page), "the notice")
        assert "the paths are not drawn" in shown_errors(page)
        assert "not traversable" in page.drive_tab._verdict.content
        ask(page, page.playback.play)
        wait_until(lambda: page.playback.time > 0.0, "the rover to drive")
        assert "the paths are not drawn" in shown_errors(page)
    ask(page, page.judged.show_path)
    wait_until(lambda: not shown_errors(page), "the notice to go")


def test_a_failed_picture_is_not_drawn_again_before_the_next_request(page, monkeypatch):
    wait_until(lambda: not page._panels.controls.outdated, "the first picture")
    tried = []

    def fail_and_count(_frame):
        tried.append(True)
        fail()

    with monkeypatch.context() as patch:
        patch.setattr(page.scene, "show", fail_and_count)
        ask(page, page.playback.play)
        wait_until(lambda: "drawing stopped" in shown_errors(page), "the notice")
        stopped_at = page.playback.time
        time.sleep(0.5)  # a dozen pictures
        assert len(tried) == 1 and page.playback.time == stopped_at
    ask(page, page.playback.play)
    wait_until(lambda: page.playback.time > stopped_at, "the rover to drive on")
    wait_until(lambda: not shown_errors(page), "the notice to go")


def test_an_error_of_a_judgement_is_shown_and_the_old_verdict_is_marked(page):
    ask(page, lambda: page._change_options(map_sigmas="many"))
    wait_until(lambda: "not judged" in shown_errors(page), "the notice")
    assert "could not convert string to float" in shown_errors(page)
    wait_until(lambda: "old values" in page.drive_tab._verdict.content, "the mark")
    wait_until(lambda: page._panels.notice._again.visible, "the button")
    assert not page._panels.notice._cancel.visible
    ask(page, lambda: page._change_options(map_sigmas=3.0))
    wait_until(lambda: not shown_errors(page), "the notice to go")
    wait_until(lambda: not page._panels.notice._again.visible, "the button to go")
    wait_until(lambda: "old values" not in page.drive_tab._verdict.content, "the mark to go")


def test_a_closed_page_leaves_no_thread_behind():
    before = set(threading.enumerate())
    page = Page(session_on(ramp), port=0)
    page.requests.add(lambda: page.session.plan_again())
    page.close()
    left = {thread.name for thread in set(threading.enumerate()) - before}
    assert not left & {"page", "judge", "ground"}


@pytest.mark.slow
def test_a_live_page_tries_again_by_itself_after_an_error(ros, monkeypatch):
    listener = ros.spin(LiveListener(context=ros.context))
    page = LivePage(session_on(ramp), listener, port=0)
    try:
        with monkeypatch.context() as patch:
            patch.setattr(page.scene, "show", fail)
            wait_until(lambda: "drawing stopped" in shown_errors(page), "the notice")
        wait_until(lambda: not shown_errors(page), "the notice to go")
        assert "waiting for odometry" in page.drive_tab._dashboard.content
    finally:
        page.close()
