# SPDX-License-Identifier: Apache-2.0
"""Times how soon the traction controller ends the push after a fault, and how soon it shows it.

The controller runs in a process of its own, with real-time priority where it is granted. Times are
from the cause to the arrival of the first command that does not push, and to the error in
diagnostics; the longest of all repeats counts.
"""

import time
from collections.abc import Callable

from std_msgs.msg import Bool
from std_srvs.srv import SetBool

from benchmarks.measure import Figure
from benchmarks.processes import CONTROLLER, START_TIME, open_nodes
from support.driven_rover import NANOSECONDS, DrivenRover
from support.ros_fixtures import call
from support.waiting import wait_until

REPEATS = 10
"""Repeats of each fault."""
PRIORITY = 50
"""Real-time priority of the controller."""
LIMIT, SHOWN_LIMIT = 100.0, 2000.0
"""Longest allowed time from a cause to zero or hold, and to an error in diagnostics [ms]."""


def measure() -> list[Figure]:
    """Measure faults of stamps and sensors, and the emergency stop."""
    figures = []
    with open_nodes() as nodes:
        rover = DrivenRover(nodes.ros.context)
        rover.send_twists()
        rover.stamp = time.time_ns
        nodes.ros.spin(rover)
        emergency_stop = rover.create_publisher(Bool, f"{CONTROLLER}/emergency_stop", 1)
        enable = rover.create_client(SetBool, f"{CONTROLLER}/enable")
        nodes.start(CONTROLLER, enabled_at_start=True, realtime_priority=PRIORITY)

        def shift_stamps(seconds: float) -> None:
            rover.stamp = lambda: time.time_ns() + round(seconds * NANOSECONDS)

        def freeze_stamps() -> None:
            now = time.time_ns()
            rover.stamp = lambda: now

        def mend() -> None:
            rover.stamp = time.time_ns
            rover.silent.clear()

        def release() -> None:
            wait_until(lambda: rover.state == "emergency_stop", "the stop")
            emergency_stop.publish(Bool(data=False))
            wait_until(lambda: rover.state == "disabled", "the release")
            call(enable, SetBool.Request(data=True))

        for name, text, cause, end in (
            ("stamps frozen", "do not advance", freeze_stamps, mend),
            ("stamps delayed by 1 s", "stale", lambda: shift_stamps(-1.0), mend),
            ("stamps 1 s in the future", "ahead", lambda: shift_stamps(1.0), mend),
            ("joint_states silent", "joint_states stale",
             lambda: rover.silent.add("joint_states"), mend),
            ("imu silent", "imu stale", lambda: rover.silent.add("imu"), mend),
            ("emergency stop", "emergency_stop",
             lambda: emergency_stop.publish(Bool(data=True)), release),
        ):  # fmt: skip
            figures += measure_fault(rover, name, text, cause, end)
    return figures


def measure_fault(
    rover: DrivenRover,
    name: str,
    text: str,
    cause: Callable[[], object],
    mend: Callable[[], object],
) -> list[Figure]:
    """Cause a fault, whose error has a text, and mend it several times."""
    rests, shown = [], []
    for _ in range(REPEATS):
        wait_until(lambda: rover.state == "driving" and rover.push > 0.0, "driving", START_TIME)
        time.sleep(0.5)
        heard, began = len(rover.commands), time.monotonic()
        cause()
        found = wait_until(
            lambda: [at for at, _, push in rover.commands[heard:] if push <= 0.0],  # noqa: B023
            "rest",
        )
        rests.append(1e3 * (found[0] - began))
        errors = wait_until(lambda: _errors(rover, text, began), f"{text!r} in diagnostics")  # noqa: B023
        shown.append(1e3 * (errors[0] - began))
        mend()
    rows = (
        ("zero or hold within", max(rests), "ms", LIMIT),
        ("in diagnostics within", max(shown), "ms", SHOWN_LIMIT),
    )
    return [Figure("faults", f"{name}: {what}", *rest, repeats=REPEATS) for what, *rest in rows]


def _errors(rover: DrivenRover, text: str, since: float) -> list[float]:
    """Return when diagnostics had an error with a text, after a time [s]."""
    statuses = list(rover.diagnostics)
    return [at for at, s in statuses if at > since and text in s.message and s.level != b"\0"]
