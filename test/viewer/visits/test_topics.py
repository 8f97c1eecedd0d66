# SPDX-License-Identifier: Apache-2.0
"""Ages of topics: what is streamed gets stale, what comes once does not."""

import time

from rover_planner.viewer.live.live_state import MAX_AGE, TopicAge
from rover_planner.viewer.panel.dashboard import draw_topics


def test_a_stream_gets_stale_and_a_result_never():
    long_ago = time.monotonic() - MAX_AGE - 22.0
    odometry, plan = (
        TopicAge(*one) for one in (("odometry", long_ago, True), ("plan", long_ago, False))
    )
    assert TopicAge("odometry", None, True).describe() == "nothing yet"
    assert not TopicAge("odometry", None, True).is_stale
    assert not TopicAge("odometry", time.monotonic(), True).is_stale
    assert odometry.is_stale and not plan.is_stale
    assert odometry.describe() == plan.describe() == f"{MAX_AGE + 22.0:.0f} s"
    text = draw_topics((odometry, plan))
    assert 'data-topic="odometry" data-stale="true"' in text
    assert 'data-topic="plan" data-stale="false"' in text
