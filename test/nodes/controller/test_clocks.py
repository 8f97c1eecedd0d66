# SPDX-License-Identifier: Apache-2.0
"""No clock and no hanging thread keeps the wheels turning with their last torque."""

import time
from unittest.mock import Mock

import numpy as np
import pytest
from rosgraph_msgs.msg import Clock as ClockMessage

from msg_adapters.joints import OWN_NAMES
from msg_adapters.stamps import NANOSECONDS, ns_to_stamp
from rover_physics.names import WHEEL_JOINTS
from rover_planner.nodes.traction_topics import TractionTopics
from support.waiting import wait_until

BOUND = 1.5
"""Longest time from the cause to zero or hold [s]: the timeouts below, and
what a busy machine adds; docs/validation.md has what was measured with the defaults."""
TIGHT = {f"{what}_timeout": 0.3 for what in ("joint_states", "imu", "watchdog", "clock")}
"""Several times the defaults, for the sake of busy machines."""


def wait_for_rest(rover, began):
    """Return the time from `began` [ns] to the last command that was sent before rest [s]."""

    def find_rest():
        return [at for at, push in rover.commands_after(began) if push <= 0.0]

    rest = wait_until(find_rest, "rest")[0]
    pushes = [at for at, push in rover.commands_after(began) if push > 0.0 and at < rest]
    return (max(pushes, default=began) - began) / NANOSECONDS


@pytest.mark.timed
def test_a_simulated_clock_that_stops_and_stamps_that_do_not_advance_are_faults_in_time(
    rover, start_controller
):
    times = [1_000_000 * NANOSECONDS]
    clock = rover.create_publisher(ClockMessage, "/clock", 10)

    def tick():
        times.append(times[-1] + 10_000_000)
        clock.publish(ClockMessage(clock=ns_to_stamp(times[-1])))

    timer = rover.create_timer(0.01, tick)
    start_controller(use_sim_time=True, **TIGHT)
    rover.wait_until_driven()
    began = time.time_ns()
    timer.cancel()
    assert wait_for_rest(rover, began) < BOUND
    wait_until(lambda: "/clock stands still" in rover.status.message, "the reason")
    timer.reset()
    rover.wait_until_driven()
    began, frozen = time.time_ns(), times[-1]
    rover.stamp = lambda: frozen
    assert wait_for_rest(rover, began) < BOUND
    wait_until(lambda: "stamps do not advance" in rover.status.message, "the reason")


@pytest.mark.timed
def test_the_watchdog_sends_zeros_and_the_brake_while_the_executor_hangs(rover, start_controller):
    controller = start_controller(**TIGHT)
    rover.wait_until_driven()
    began = time.time_ns()
    controller.create_guard_condition(lambda: time.sleep(1.5)).trigger()
    controller.executor.wake()
    wait_until(lambda: rover.state == "fault", "the watchdog")
    assert wait_for_rest(rover, began) < BOUND
    wait_until(lambda: rover.brakes[-1] and rover.torque == 0.0, "zeros and the brake")
    zeros = [at for at, push in rover.commands_after(began) if push == 0.0]
    assert zeros[0] - began < 1.4 * NANOSECONDS  # while it hangs
    wait_until(lambda: rover.state == "driving", "driving again")
    wait_until(lambda: rover.count_lines("updates came too late"), "the reason in the log")
    wait_until(lambda: int(rover.values["watchdog_trips"]), "the trip in the diagnostics")


def test_a_state_that_the_watchdog_tells_late_does_not_stay():
    topics, told = TractionTopics(Mock(values=Mock(joints=WHEEL_JOINTS)), Mock(), OWN_NAMES), []
    topics.state = Mock(publish=lambda message: told.append(message.data))

    def drive():
        topics.write(np.ones(6), False, "driving")

    topics.brake = Mock(publish=lambda message: message.data and drive())
    topics.write(np.zeros(6), True, "fault")
    drive()
    assert told == ["driving", "fault", "driving"]
