# SPDX-License-Identifier: Apache-2.0
"""Times updates of the traction controller: alone, and for a minute beside a busy server.

Alone, the node gets the measurements of a drive over rocks; CPU time is measured. Then simulator,
controller and server run in separate processes. The controller's diagnostics report the elapsed
time of its updates (estimate, build, solve, publish) and the number of missed cycles.
"""

import time

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.parameter import Parameter

from benchmarks.bench_service import GOAL, START
from benchmarks.measure import Figure
from benchmarks.processes import CONTROLLER, DOMAIN, SERVER, open_nodes
from rover_physics import load_rover
from rover_physics.names import STEERING_JOINTS, SUSPENSION_JOINTS, WHEEL_JOINTS
from rover_physics.traction.contact_ekf import Motion
from rover_planner.nodes.traction_controller import TractionController
from rover_planner.ros.qos import TOPIC_QOS
from rover_planner.worlds.mars_terrain import make_mars_terrain
from support.grounds import rocky
from support.ros_fixtures import RosRun, hear
from support.traction_states import drive_states
from support.waiting import wait_until

RATE = 100.0
"""Rate of the controller [Hz]."""
SPEED = 0.03
"""Wanted speed [m/s]."""
TOGETHER_TIME = 60.0
"""Time for which everything runs together [s]."""
ALONE_TIME = 20.0
"""Time for which updates are measured alone [s]."""
PRIORITY = 50
"""Real-time priority (SCHED_FIFO) of the controller, as in ros2_control, if it is granted."""
REPORTED = ("updates", "missed_cycles", "fallbacks", "update_time_median_ms", "update_time_p99_ms")
"""Values of the diagnostics that are read."""


def measure() -> list[Figure]:
    """Measure updates alone, then beside simulator and server."""
    return measure_alone() + measure_together()


def measure_alone() -> list[Figure]:
    """Measure a node that updates and publishes at RATE, on a drive over rocks."""
    prediction, motions, duration = drive_states(load_rover("lsr1"), rocky(1))
    assert prediction.settled.all(), "the rover must settle everywhere on the path"
    ros, enabled = RosRun(DOMAIN), [Parameter("enabled_at_start", value=True)]
    node, times = TractionController(context=ros.context, parameter_overrides=enabled), []
    began = time.monotonic()
    for k in range(int(RATE * ALONE_TIME)):
        time.sleep(max(began + k / RATE - time.monotonic(), 0.0))
        place, share = divmod(k / RATE / duration, 1.0)
        _take(node, _blend(motions[int(place)], motions[int(place) + 1], share))
        start = time.thread_time()
        node.update()
        times.append(1e3 * (time.thread_time() - start))
        assert node.statistics.last.answer is not None, node.statistics.last.fault
    node.destroy_node()
    ros.close()
    name = "update alone (estimate, build, solve, publish), CPU time: "
    median, late = np.percentile(times, [50, 99])
    return [
        Figure("traction", name + "median", float(median), "ms", 0.5, repeats=len(times)),
        Figure("traction", name + "99 of 100 within", float(late), "ms", 2.0, repeats=len(times)),
    ]


def _blend(before: Motion, after: Motion, share: float) -> Motion:
    """Return a measurement interpolated between two others; `share` is 0 to 1."""
    pairs = zip(before, after, strict=True)
    return Motion(*((1.0 - share) * first + share * second for first, second in pairs))


def _take(node: TractionController, motion: Motion) -> None:
    """Give a node the measurements of a rover."""
    now, (rocker, *bogies) = time.monotonic(), motion.joints
    positions = dict(zip(SUSPENSION_JOINTS, (rocker, -rocker, *bogies), strict=True))
    positions |= dict(zip(STEERING_JOINTS, motion.steering, strict=True))
    rocker, *bogies = motion.joint_rates
    rates = (rocker, -rocker, *bogies, *motion.wheel_rates)
    velocities = dict(zip((*SUSPENSION_JOINTS, *WHEEL_JOINTS), rates, strict=True))
    node.service.take_joints(positions, velocities, now)
    node.service.take_attitude(*motion.attitude, motion.body_rates, now)
    node.service.take_command(SPEED, 0.0, now)


def wait_for_updates(heard: list[DiagnosticArray], count: float) -> dict[str, float]:
    """Return the REPORTED values of the controller once it has made `count` updates."""

    def find_values() -> dict[str, str]:
        statuses = (status for message in heard[::-1] for status in message.status)
        last = next((one for one in statuses if one.name.startswith(CONTROLLER)), None)
        found = {item.key: item.value for item in last.values} if last else {}
        return found if float(found.get("updates", 0)) >= count else {}

    values = wait_until(find_values, "updates", 120.0)
    return {key: float(values[key]) for key in REPORTED}


def measure_together() -> list[Figure]:
    """Measure the node while a simulator and a busy server run beside it."""
    ground = make_mars_terrain(1, 24.0, 0.05)
    with open_nodes() as nodes:
        client = nodes.client()
        heard = hear(client.node, DiagnosticArray, "/diagnostics", TOPIC_QOS)
        nodes.start(SERVER, terrain_file=ground, candidate_count=1)
        client.first_plan(START, GOAL)
        nodes.start(CONTROLLER, rate=RATE, realtime_priority=PRIORITY, enabled_at_start=True)
        start = {"start_x": START[0], "start_y": START[1], "follow_commands": True}
        nodes.start("rover_simulator", rate=RATE, terrain_file=ground, **start)
        before = wait_for_updates(heard, RATE)
        end = time.monotonic() + TOGETHER_TIME
        while time.monotonic() < end:
            client.plan(START, GOAL)
        after = wait_for_updates(heard, before["updates"] + 0.9 * RATE * TOGETHER_TIME)
    updates = int(after["updates"] - before["updates"])
    together = "the same beside simulator and busy server, by the clock"
    rows = (
        (f"{together}: median", after["update_time_median_ms"], "ms", 0.5),
        ("the same: 99 of 100 within", after["update_time_p99_ms"], "ms", 2.0),
        ("cycles missed at 100 Hz in a minute, a server busy beside it",
         after["missed_cycles"] - before["missed_cycles"], "", 0.0),
        ("updates that fell back to equal torques", after["fallbacks"], "", None),
    )  # fmt: skip
    return [Figure("traction", *row, repeats=updates) for row in rows]
