# SPDX-License-Identifier: Apache-2.0
"""Links that a page opens: what it cannot show is refused, and no link acts later."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from rover_planner.viewer.browser.link import PageLink
from rover_planner.viewer.pages.page import Page
from rover_planner.viewer.state.session import ViewSession
from support.grounds import make_terrain, waves
from support.viewer.sessions import LSR1, PATIENCE, ask, wait_for_rest
from support.waiting import wait_until


@pytest.fixture
def page() -> Iterator[Page]:
    session = ViewSession(LSR1, make_terrain(waves), (-2.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    served = Page(session, port=0)
    wait_for_rest(served)
    yield served
    served.close()


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"ground": "00000000"}, "the link is about another map"),
        ({"policy": "magic"}, "no torque policy 'magic'; policies are equal, servo, optimal"),
        ({"soil": "mud"}, "no soil 'mud'; soils are "),
        ({"joints": {"wing": 1.0}}, "the link turns the joint 'wing', which lsr1 lacks"),
    ],
)
def test_a_link_with_unknown_names_is_refused_and_nothing_else_changes(page, change, reason):
    wanted, shown = page.session.wanted, []
    choose = page.ground_tab.show_options
    page.ground_tab.show_options = lambda options: (shown.append(options), choose(options))
    link: PageLink = replace(page.sharing.make_link(), **change)
    ask(page, lambda: page.open_link(link))
    assert page.session.refusal.startswith(reason)
    assert page.session.wanted is wanted and page.errors.messages == {}
    assert shown == []


def test_path_and_time_of_a_link_to_fewer_paths_do_not_come_with_a_later_goal(page):
    link = replace(page.sharing.make_link(), goal=(-2.0, 0.0, 0.0), path=5, time=20.0)
    ask(page, lambda: page.open_link(link))
    wait_for_rest(page)
    assert len(page.session.shown.candidates) < 5  # it stays where it is: nothing to choose from
    ask(page, lambda: page.plan(np.array([1.0, 0.5])))
    wait_for_rest(page)
    assert page.session.shown.index == page.session.shown.answer.nearest != 4
    assert page.playback.time == 0.0


def test_path_and_time_of_a_link_come_with_its_paths(page):
    link = replace(page.sharing.make_link(), goal=(1.0, 0.5, 0.1), path=4, time=20.0)
    ask(page, lambda: page.open_link(link))
    wait_until(lambda: page.session.shown.index == 3, "the path", PATIENCE)
    wait_until(lambda: page.playback.time == 20.0, "the time", PATIENCE)
