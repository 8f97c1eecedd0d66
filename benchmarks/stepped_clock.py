# SPDX-License-Identifier: Apache-2.0
"""A publisher of /clock that runs as the steady clock does, and is stepped ahead and back in turn.

python -m benchmarks.stepped_clock PERIOD: seconds between two steps.
"""

import contextlib
import itertools
import sys
import time

import rclpy
from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock

TICK = 0.02
"""Time between two messages [s]."""
START = 1000.0
"""Time at the start [s]."""
STEPS = (5.0, -5.0)
"""Steps in turn [s]."""


def publish_clock(period: float) -> None:
    """Publish the time until interrupted, with a step each period [s]."""
    rclpy.init()
    publisher = rclpy.create_node("stepped_clock").create_publisher(
        Clock, "/clock", QoSProfile(depth=1)
    )
    begin = time.monotonic()
    offset, steps, next_step = START - begin, itertools.cycle(STEPS), begin + period
    with contextlib.suppress(KeyboardInterrupt):
        while True:
            now = time.monotonic()
            if now >= next_step:
                offset += next(steps)
                next_step += period
            message = Clock()
            message.clock.sec, nanoseconds = divmod(round(1e9 * (now + offset)), 10**9)
            message.clock.nanosec = nanoseconds
            publisher.publish(message)
            time.sleep(TICK)


if __name__ == "__main__":
    publish_clock(float(sys.argv[1]))
