# SPDX-License-Identifier: Apache-2.0
"""The page that the tests in a browser share, one of each file, and its visitor."""

from collections.abc import Iterator

import pytest


@pytest.fixture(scope="module")
def browser() -> Iterator[object]:
    from support.viewer.visits import open_browser

    with open_browser() as chromium:
        yield chromium


@pytest.fixture(scope="module")
def page():
    """A page at rest; of its paths around a block one passes, and beyond the goal is a wall."""
    from rover_planner.viewer.pages.page import Page
    from support.viewer.sessions import blocked_session, wait_for_rest

    served = Page(blocked_session(), port=0)
    wait_for_rest(served)
    served.home = served.session.wanted
    yield served
    served.close()


@pytest.fixture(scope="module")
def opened(page, browser):
    """A visitor of the page; neither may tell an error at the end."""
    from support.viewer.browser import Visitor

    visitor = Visitor(browser, page.url, sees_scene=False)
    yield visitor
    assert visitor.page_errors == [] and page.errors.messages == {}


@pytest.fixture
def visitor(opened, page):
    """The visitor before the best path of lsr1, paused at the start, with the tab Drive open.

    The scene is tiny, because without a graphics card drawing it is slow.
    """
    from support.viewer.sessions import ask, wait_for_rest
    from support.viewer.visits import wait_for_browser

    session = page.session

    def begin_anew() -> None:
        page.playback.go_to(0.0)
        page.drive_tab.outdated = True
        if session.wanted is not page.home:
            session.take_scenario(page.home)
            page.judged.show_inputs()
        elif session.shown.index != session.shown.answer.nearest:
            session.show_candidate(session.shown.answer.nearest)
        page.judged.show_verdict()

    ask(page, begin_anew)
    wait_for_rest(page)
    opened.shrink_scene()
    wait_for_browser(page, opened)
    opened.open_tab("Drive")
    opened.wait_for("paused")
    return opened


@pytest.fixture
def onlooker(visitor):
    """The same visitor, who sees the whole scene from where it is seen at first."""
    visitor.show_scene()
    visitor.hide_notices()
    visitor.press("Fit")
    visitor.wait_for_ground()
    return visitor
