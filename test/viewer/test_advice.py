# SPDX-License-Identifier: Apache-2.0
"""The page advises on the path that is looked at, and judges it with a remedy that is taken."""

from dataclasses import replace

import pytest

pytest.importorskip("viser", reason="no viser: pip install '.[view]'")

from rover_planner.advice.advise import grow_advice
from rover_planner.advice.case import case_of
from rover_planner.planning.path_query import PathQueryOptions
from rover_planner.viewer.documents.advice import PROMISED, apply_remedy, describe_advice
from rover_planner.viewer.pages.page import Page
from support.grounds import rock_left
from support.viewer.sessions import LSR1, ask, session_on, wait_for_rest
from support.waiting import wait_until

ENDS = (-1.5, 0.0, 0.0), (1.5, 0.0, 0.0)
OPTIONS = PathQueryOptions(count=1, waypoint_spacing=0.05)


def test_a_path_passes_with_the_values_that_a_remedy_has():
    slippery, levers = replace(LSR1, friction=0.45), {"policy", "friction"}
    session = session_on(lambda x, y: 0.3 * x, *ENDS, OPTIONS, slippery)
    path, wanted = session.shown.path, session.wanted
    assert not path.verdict.traversable
    growing = grow_advice(case_of(wanted.site, path.poses))
    found = ((one, {remedy.levers[0].lever.name for remedy in one.found}) for one in growing)
    advice = next(one for one, names in found if names >= levers)
    for remedy in advice.remedies:
        session.take_change(apply_remedy(wanted, remedy))
        assert session.shown.verdict.traversable, remedy.describe()
        session.undo()
        assert not session.shown.verdict.traversable


@pytest.fixture
def page():
    served = Page(session_on(rock_left, *ENDS, OPTIONS))
    wait_for_rest(served)
    yield served
    served.close()


def test_advice_is_sought_when_it_is_asked_for_shown_as_a_ghost_and_taken(page):
    assert page.channel.parts["advice"]["can_ask"]
    page.hear({"ask": "advise"})

    def find_path() -> str:
        rows = [row["words"] for row in page.channel.parts["advice"]["rows"] if row["taken"]]
        return next((words for words in rows if words.startswith("Drive ")), "")

    place = wait_until(find_path, "another path", 60.0)
    page.hear({"ask": "ghost", "words": place})
    wait_until(lambda: "/lines/ghost" in page.scene.canvas.nodes, "the ghost")
    page.hear({"ask": "remedy", "words": place})
    wait_until(lambda: page.channel.parts["verdict"]["passes"], "the verdict with the remedy")
    page.hear({"ask": "ghost", "words": place})  # it is of an earlier path now
    ask(page, lambda: None)
    assert page.session.refusal == "" and "/lines/ghost" not in page.scene.canvas.nodes
    page.hear({"ask": "remedy", "words": place})
    wait_until(lambda: "no remedy of the path" in page.session.refusal, "the reason")
    assert page.errors == {}


def test_a_search_tells_what_was_found_by_a_promised_time_and_that_it_goes_on():
    path, at = session_on(rock_left, *ENDS, OPTIONS).shown.path, 1000.0
    growing = grow_advice(case_of(path.scenario.site, path.poses))
    none, some = next(growing), next(one for one in growing if one.remedies)
    last = replace(some, complete=True)
    told = describe_advice(none, at, True, at + 0.5 * PROMISED)
    assert told["words"] == "tried: nothing yet" and not told["can_ask"]
    for advice, found in ((none, "nothing"), (last, str(len(last.remedies + last.others)))):
        words = describe_advice(advice, at, True, at + PROMISED)["words"]
        assert words.startswith(f"{found} found so far; the search goes on, tried: ")
    ended = describe_advice(last, at, False, at)
    assert not ended["can_ask"] and ended["words"] == "" and ended["rows"]


def test_a_search_that_is_stopped_tells_so_and_one_ends_when_nobody_looks_at_its_path(page):
    page.hear({"ask": "advise"})
    page.hear({"ask": "cancel"})
    words = "the search was stopped before it found anything"
    wait_until(lambda: page.channel.parts["advice"]["words"] == words, "the words")
    assert page.channel.parts["advice"]["can_ask"] and page._advised is None
    page.hear({"ask": "advise"})
    wait_until(lambda: page._advice.progress, "the search")
    page.hear({"ask": "value", "label": "friction [-]", "value": 0.7})
    wait_until(lambda: page.session.shown.scenario.rover.friction == 0.7, "the verdict")
    wait_until(lambda: page._advice.progress is None, "the end of the search")
    wait_until(lambda: page.channel.parts["advice"]["can_ask"], "the question")
    assert page._advised is None and not page.channel.parts["advice"]["rows"]
