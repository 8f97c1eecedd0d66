# SPDX-License-Identifier: Apache-2.0
"""Tests of the verdicts under all torque policies, side by side."""

from dataclasses import replace

import numpy as np

from rover_planner.viewer.panel.dashboard import describe_verdict
from rover_planner.viewer.state.scenario import PolicyVerdict
from rover_planner.viewer.state.session import ViewSession
from support.grounds import make_terrain
from support.viewer.sessions import LSR1, ramp, session_on


def verdicts(session) -> dict[str, bool | None]:
    return {one.policy: one.traversable for one in session.shown.by_policy}


def test_a_path_is_judged_under_all_policies_and_changes_with_the_rover():
    session = session_on(ramp)
    assert verdicts(session) == {"equal": True, "servo": True, "optimal": True}
    assert session.change_rover([("friction",)], 0.1)
    assert verdicts(session) == {"equal": False, "servo": False, "optimal": False}
    assert all(one.reason for one in session.shown.by_policy)


def test_a_policy_that_cannot_judge_the_ground_says_so():
    ground = make_terrain(ramp)
    ground = replace(ground, elevation_std=np.full(ground.elevation.shape, 1e-3))
    session = ViewSession(LSR1, ground, (-2.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    judged = {one.policy: one for one in session.shown.by_policy}
    assert judged["servo"].traversable is None and "no bounds" in judged["servo"].reason
    assert judged["equal"].traversable is not None


def test_the_page_shows_a_box_for_each_policy_with_its_reason():
    compared = (
        PolicyVerdict("equal", False, "a <wheel> slips"),
        PolicyVerdict("servo", True, ""),
        PolicyVerdict("optimal", None, "no"),
    )
    text = describe_verdict(False, "a wheel slips", "", "", compared)
    assert text.count("<b>passes</b>") == text.count("<b>not judged</b>") == 1
    assert 'title="a &lt;wheel&gt; slips"' in text
