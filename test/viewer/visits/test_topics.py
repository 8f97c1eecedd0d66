# SPDX-License-Identifier: Apache-2.0
"""Ages of topics: what is streamed gets stale, what comes once does not."""

from rover_planner.viewer.live.topic_ages import MAX_AGE, TopicAges
from rover_planner.viewer.panel.dashboard import draw_topics


def test_a_stream_gets_stale_and_fresh_again_and_a_result_never():
    clock = [100.0]
    ages = TopicAges(lambda: clock[0])
    ages.expect("odometry", is_stream=True)
    ages.expect("plan", is_stream=False)
    assert [one.describe() for one in ages.list_all()] == ["nothing yet"] * 2
    assert not ages.is_stale("odometry")
    ages.hear("odometry")
    ages.hear("plan")
    clock[0] += MAX_AGE + 22.0
    assert ages.is_stale("odometry") and not ages.is_stale("plan")
    odometry, plan = ages.list_all()
    assert odometry.describe() == plan.describe() == f"{MAX_AGE + 22.0:.0f} s"
    text = draw_topics(ages.list_all())
    assert 'data-topic="odometry" data-stale="true"' in text
    assert 'data-topic="plan" data-stale="false"' in text
    ages.hear("odometry")
    assert not ages.is_stale("odometry")
