# SPDX-License-Identifier: Apache-2.0
"""Ages of topics: what is streamed gets stale, what comes once does not."""

import time

from rover_planner.viewer.live.live_state import MAX_AGE, TopicAge
from rover_planner.viewer.panel.dashboard import draw_topics


def test_a_stream_gets_stale_and_a_result_never():
    now = time.monotonic()
    odometry, plan, none, fresh = (
        TopicAge("odometry", now - MAX_AGE - 22.0, True),
        TopicAge("plan", now - MAX_AGE - 22.0, False),
        TopicAge("odometry", None, True),
        TopicAge("odometry", now, True),
    )
    assert [one.is_stale for one in (odometry, plan, none, fresh)] == [True, False, False, False]
    assert odometry.describe() == plan.describe() == f"{MAX_AGE + 22.0:.0f} s"
    assert none.describe() == "nothing yet"
    text = draw_topics((odometry, plan))
    assert 'data-topic="odometry" data-stale="true"' in text
    assert 'data-topic="plan" data-stale="false"' in text
