# SPDX-License-Identifier: Apache-2.0
"""The report of a page that is sent: numbers that are not known, and names that are no HTML."""

import re
from dataclasses import replace
from types import SimpleNamespace

import pytest

from rover_planner.viewer.browser.report import describe_judgement, write_page
from rover_planner.viewer.state.context import describe_scenario
from support.grounds import gap
from support.viewer.sessions import session_on

viser = pytest.importorskip("viser", reason="no viser: pip install '.[view]'")


def report_of(session) -> str:
    judgement = session.shown
    return describe_judgement(judgement, describe_scenario(judgement.scenario, "gap.npz"), "")


def test_numbers_of_a_rover_that_never_settles_are_not_known():
    report = report_of(session_on(gap, start=(0.4, 0.0, 0.0), goal=(1.9, 0.0, 0.0)))
    assert "does not settle there" in report and "nan" not in report
    assert "<th>largest tilt</th><td>? deg</td>" in report


@pytest.mark.parametrize("value", [float("inf"), float("nan")])
def test_what_has_no_bound_is_said_in_words(value):
    session = session_on(gap)
    judged = session.shown
    verdict = replace(judged.verdict, max_friction_utilisation=value)
    candidate = replace(judged.candidate, verdict=verdict)
    session.shown = replace(judged, candidate=candidate)
    word = "infinite" if value > 0.0 else "?"
    assert f"<th>largest friction utilisation</th><td>{word}</td>" in report_of(session)


def test_the_name_of_a_rover_is_text_in_the_title_of_a_file_and_in_its_heading():
    server = viser.ViserServer("127.0.0.1", 0, verbose=False)
    camera = SimpleNamespace(position=(0.0, 0.0, 1.0), look_at=(0.0, 0.0, 0.0))
    try:
        page = write_page(server, camera, "", r"<script>\1 & co").decode()
    finally:
        server.stop()
    safe = r"&lt;script&gt;\1 &amp; co"
    assert re.search("<title>(.*?)</title>", page).group(1) == safe
    assert f"<h1>{safe}</h1>" in page and r"<script>\1" not in page
