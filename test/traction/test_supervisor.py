# SPDX-License-Identifier: Apache-2.0
"""The rover drives only while it may; at rest it is held, braked or left to coast."""

import numpy as np
import pytest

from rover_planner.traction.loops import StallWatch
from rover_planner.traction.supervisor import RECOVERY_TIME, STANDSTILL_DELAY
from support.creeping_rover import INPUTS, PERIOD, CreepingRover


def test_an_emergency_stop_acts_with_the_next_update_and_must_be_followed_by_enabling():
    rig = CreepingRover(enabled=False)
    supervisor = rig.supervisor
    assert rig.run(1.0).state == "disabled"
    assert supervisor.set_enabled(True) == (True, "enabled")
    assert rig.run(1.0).state == "driving"
    supervisor.take_emergency_stop(True)
    command = rig.run(PERIOD)
    assert command.state == "emergency_stop" and (command.torques < 0.0).all()
    done, why = supervisor.set_enabled(True)
    assert not done and "~/emergency_stop" in why
    supervisor.take_emergency_stop(False)
    assert rig.run(1.0).state == "disabled"
    assert supervisor.set_enabled(True)[0]
    assert rig.run(PERIOD).state == "driving"


def test_the_watch_of_the_path_holds_the_rover_and_where_it_is_expected_so_does_its_silence():
    rig = CreepingRover()
    service = rig.service
    assert rig.run(1.0).state == "driving"  # nobody told it to expect a watch
    service.take_stop(True, rig.now)
    command = rig.run(PERIOD)
    assert command.state == "fault" and "stop is true" in command.fault
    service.take_stop(False, rig.now)
    assert rig.run(1.0).state == "driving"  # by itself, with the next accepted path
    rig = CreepingRover(stop_timeout=0.4)
    assert "waiting for traverse_server/stop" in rig.run(1.0).fault
    rig.service.take_stop(False, rig.now)
    assert rig.run(0.36).state == "driving" and rig.updates[-1].expiry <= rig.now + 0.06
    command = rig.run(0.08)
    assert command.state == "fault" and "stop stale: none for 400 ms" in command.fault


def test_hold_brakes_wheels_that_turn_and_stays_within_the_limit():
    rig = CreepingRover(max_torque=0.1)
    rig.run(1.0)
    torques = [rig.run(PERIOD, "joint_states", "imu").torques for _ in range(200)]
    assert rig.updates[-1].state == "fault" and not rig.updates[-1].brake
    assert max(np.abs(torque).max() for torque in torques) <= 0.1
    assert (torques[-1] == -0.1).all()
    rig.turn_wheels(-0.2)
    assert (rig.run(1.0, "joint_states").torques > -0.1).all()


def test_hold_starts_from_the_torques_that_balance_the_weight_on_a_slope():
    rig = CreepingRover(enabled=False)
    rig.turn_wheels(0.0)
    rig.pitch = np.radians(20.0)
    rover = rig.service.settings.rover
    wanted = -rover.weight * np.sin(rig.pitch) * rover.wheel.radius
    assert rig.run(0.1).torques.sum() == pytest.approx(wanted)


@pytest.mark.parametrize(
    ("policy", "lost", "timeout", "brake"),
    [
        ("hold", "joint_states", 0.08, True),
        ("brake", "imu", 0.08, True),
        ("coast", "cmd_vel", 0.52, False),
    ],
)
def test_after_the_timeout_of_a_lost_input_brake_coast_and_hold_without_rates_give_no_torque(
    policy, lost, timeout, brake
):
    rig = CreepingRover(rest_policy=policy)
    command = rig.run(1.0)
    assert not command.brake and command.torques.any()
    command = rig.run(timeout, *(name for name in INPUTS if name != lost))
    assert command.state == "fault" and command.fault.startswith(f"{lost} stale")
    assert command.brake == brake and not command.torques.any()
    assert rig.run(0.1).brake == (policy == "brake")  # hold takes over again
    command = rig.run(RECOVERY_TIME)
    assert command.state == "driving" and command.torques.any()


def test_driving_goes_on_from_the_torques_of_rest():
    rig = CreepingRover(torque_rate=1.0)
    rig.turn_wheels(0.0)
    rig.pitch = -np.radians(20.0)
    rig.command = (0.0, 0.0)
    held = rig.run(1.0).torques
    rig.command = (0.03, 0.0)
    first = rig.run(PERIOD)
    assert first.state == "driving" and np.abs(first.torques - held).max() <= 1.0 * PERIOD + 1e-9
    assert first.torques.sum() > 0.8 * held.sum()


def test_an_input_that_is_bad_every_other_time_is_one_fault():
    rig = CreepingRover()
    rig.run(1.0)
    rig.updates.clear()
    for k in range(100):
        if k % 2:
            rig.service.monitor.refuse("imu", "imu is nan", rig.now + PERIOD)
            rig.run(PERIOD, "joint_states", "cmd_vel")
        else:
            rig.run(PERIOD)
    assert [command.state for command in rig.updates] == ["driving"] + 99 * ["fault"]
    assert rig.run(RECOVERY_TIME + 0.1).state == "driving"


def test_a_fault_found_elsewhere_counts_from_the_next_update_on():
    rig = CreepingRover()
    rig.run(1.0)
    rig.supervisor.trip("updates came too late")
    assert rig.run(RECOVERY_TIME - PERIOD).fault == "updates came too late"
    assert rig.run(1.0).state == "driving"
    command = rig.supervisor.fail("an error")
    assert command.brake and not command.torques.any() and rig.run(PERIOD).fault == "an error"


def test_a_rover_that_makes_no_progress_stops_pushing_until_it_is_commanded_otherwise():
    rig = CreepingRover(stall_time=2.0)
    rig.turn_wheels(0.0)
    assert rig.run(1.9).state == "driving"
    pushed = np.abs(rig.updates[-1].torques).sum()
    command = rig.run(0.2)
    assert command.state == "stalled" and np.abs(command.torques).sum() < 0.01 * pushed
    assert rig.run(5.0).state == "stalled"
    rig.command = (-0.03, 0.0)
    assert rig.run(PERIOD).state == "driving"
    rig.command = (0.03, 0.0)
    assert rig.run(2.2).state == "stalled"
    rig.command = (0.0, 0.0)
    assert rig.run(STANDSTILL_DELAY - 0.1).state == "driving"
    assert rig.run(0.2).state == "standstill"
    rig.command = (0.03, 0.0)
    assert rig.run(1.0).state == "driving"
    rig.run(2.0)
    for enabled in (False, True):
        rig.supervisor.set_enabled(enabled)
        assert rig.run(PERIOD).state == ("driving" if enabled else "disabled")


def test_a_rover_that_climbs_slowly_is_not_stalled():
    rig = CreepingRover(stall_time=2.0)
    rig.turn_wheels(0.0)
    for _ in range(150):
        rig.positions["bogie_left"] += 0.002
        assert rig.run(PERIOD).state == "driving"


@pytest.mark.parametrize("wanted", [(-0.3, 0.3), (0.3, 0.0)])
def test_a_rover_that_does_not_turn_is_stalled_one_that_turns_is_not(wanted):
    turns = np.repeat(wanted, 3)
    for rates, stalled in ((turns, False), (np.zeros(6), True), (-turns, True)):
        watch = StallWatch()
        found = [watch.update(rates, turns, 0.02, 2.0) for _ in range(110)]
        assert found[-1] == stalled
    assert watch.update(turns, turns, 0.02, 2.0)
    assert not watch.update(turns, -turns, 0.02, 2.0)
