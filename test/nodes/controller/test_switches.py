# SPDX-License-Identifier: Apache-2.0
"""Enabling, emergency stop, rest and the end of the node over DDS."""

import math
import signal
import time
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Bool
from std_srvs.srv import SetBool

from rover_planner.nodes.traction_controller import TractionController
from rover_planner.ros.qos import SENSOR_QOS, TOPIC_QOS
from support.ros_fixtures import PATIENT, call, run_in_executor
from support.waiting import repeat_until, wait_until


@pytest.fixture
def enable(rover):
    """Return a function that calls ~/enable."""
    client = rover.create_client(SetBool, "traction_controller/enable")
    return lambda data: call(client, SetBool.Request(data=data))


def test_a_node_starts_disabled_and_drives_once_it_is_enabled(
    rover, start_rover, start_controller, enable
):
    node = start_controller(enabled_at_start=False, rest_policy="coast")
    wait_until(lambda: rover.state == "disabled", "the state")
    wait_until(lambda: len(rover.commands) > 20, "commands")
    assert not any(torque for _, torque, _ in rover.commands)
    # At rest inputs are read at a third of the rate; commands come at the whole one.
    spacing = np.median(np.diff([sent for sent, _, _ in rover.commands])) / 1e9
    assert spacing == pytest.approx(1.0 / node.values.rate, rel=0.3)
    answer = enable(True)
    assert (answer.success, answer.message) == (True, "enabled")
    rover.wait_until_driven()
    late = start_rover(kind=None)
    wait_until(lambda: late.state == "driving" and late.brakes[-1:] == [False], "latched state")
    assert enable(False).message == "disabled"
    wait_until(lambda: rover.state == "disabled" and rover.torque == 0.0, "rest")
    wait_until(lambda: rover.status.message.startswith("disabled: call"), "the diagnostics")
    assert rover.status.level == rover.status.OK


def test_at_rest_inputs_are_read_with_each_third_update_or_before_they_are_old(ros, monkeypatch):
    node = TractionController(context=ros.context)
    read, expiry = [], math.inf
    monkeypatch.setattr(node.heard, "poll", lambda: read.append(node.statistics.updates))

    def find(now):
        command = node._supervisor.update(now)
        return replace(command, expiry=expiry)

    monkeypatch.setattr(node, "_find_command", find)
    for _ in range(6):
        node.update()
    assert read == [0, 3]
    expiry = 0.0  # what the next commands follow from is old at once
    for _ in range(3):
        node.update()
    assert read == [0, 3, 6, 7, 8]
    node.destroy_node()


@pytest.mark.parametrize("qos", [TOPIC_QOS, SENSOR_QOS], ids=["reliable", "best_effort"])
def test_every_emergency_stop_is_heard_and_acts_within_one_cycle(rover, controller, enable, qos):
    button = rover.create_publisher(Bool, "traction_controller/emergency_stop", qos)
    wait_until(button.get_subscription_count, "who hears the button")
    button.publish(Bool(data=True))
    pressed = time.time_ns()
    wait_until(lambda: rover.state == "emergency_stop", "the stop")
    heard = len(rover.commands)
    wait_until(lambda: len(rover.commands) > heard + 10, "commands")
    # An update may be under way, and another one due, when the stop comes.
    assert sum(push > 0.0 for _, push in rover.commands_after(pressed)) <= 2
    assert not enable(True).success
    button.publish(Bool(data=False))
    wait_until(lambda: rover.state == "disabled", "the release")
    wait_until(lambda: rover.count_lines("emergency stop released"), "the release in the log")
    assert rover.count_lines("emergency stop released") == 1


def test_an_emergency_stop_from_before_the_start_is_heard(rover, start_controller):
    qos = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    button = rover.create_publisher(Bool, "traction_controller/emergency_stop", qos)
    button.publish(Bool(data=True))
    start_controller()
    wait_until(lambda: rover.state == "emergency_stop", "the stop")


def test_a_stop_of_the_watch_holds_the_rover_and_so_does_its_absence(rover, start_controller):
    watch = rover.create_publisher(Bool, "traverse_server/stop", TOPIC_QOS)
    start_controller(stop_timeout=0.5)
    wait_until(lambda: "waiting for traverse_server/stop" in rover.status.message, "the fault")
    go_on = partial(watch.publish, Bool(data=False))
    repeat_until(go_on, lambda: rover.state == "driving" and rover.push > 0.0, "the drive")
    watch.publish(Bool(data=True))
    wait_until(lambda: "stop is true" in rover.status.message, "the stop")


def test_a_node_that_ends_sends_zeros_last(rover, controller):
    run_in_executor(controller, controller.stop)
    wait_until(lambda: rover.torque == 0.0 and rover.brakes[-1], "zeros and the brake")
    wait_until(lambda: rover.state == "disabled", "the state")


@pytest.mark.long
def test_a_process_that_is_told_to_end_sends_zeros_last(rover, start_process):
    values = {"enabled_at_start": "true"} | PATIENT
    given = [f"{name}:={value}" for name, value in values.items()]
    process = start_process("traction_controller", *given)
    wait_until(lambda: rover.commands, "the node", 120.0)
    wait_until(lambda: rover.push > 0.0, "torque")
    process.send_signal(signal.SIGTERM)
    assert process.wait(timeout=20.0) == 0
    wait_until(lambda: rover.torque == 0.0, "zeros")
