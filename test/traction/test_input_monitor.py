# SPDX-License-Identifier: Apache-2.0
"""Inputs that are missing, bad or stale are named; frozen, delayed and future stamps are seen."""

import pytest

from msg_adapters.stamps import NANOSECONDS
from rover_physics.names import SUSPENSION_JOINTS, WHEEL_JOINTS
from rover_planner.traction.input_monitor import NEVER, ClockWatch, InputMonitor, StampError
from rover_planner.traction.joint_memory import JointMemory
from support.rovers import FIXED

CLOCK = 1_000_000 * NANOSECONDS
MILLISECOND = NANOSECONDS // 1000
ANGLES = dict.fromkeys(SUSPENSION_JOINTS, 0.1)
RATES = dict.fromkeys(WHEEL_JOINTS, 0.2)


def test_missing_inputs_are_named_first_then_bad_ones_until_measured_anew_then_stale_ones():
    monitor = InputMonitor({"a": 0.1, "b": 0.1})
    assert monitor.find_fault(0.0) == "waiting for a, b"
    assert not monitor.is_fresh("a", -1e12)
    monitor.take("a", 0.0)
    monitor.refuse("b", "b is nan", 0.04)
    monitor.take("b", 0.03)
    assert monitor.find_fault(0.04) == "b is nan" and not monitor.is_fresh("b", 0.04)
    monitor.take("b", 0.05)
    assert monitor.find_fault(0.1) == "" and monitor.is_fresh("a", 0.1)
    assert monitor.find_fault(0.12) == "a stale: none for 100 ms"
    assert not monitor.is_fresh("a", 0.12) and monitor.expiry == pytest.approx(0.1)


def test_why_messages_were_not_used_is_told_with_the_fault():
    monitor = InputMonitor({"a": 0.1})
    monitor.ignore("a", "stamps do not advance")
    assert monitor.find_fault(0.0) == "waiting for a (stamps do not advance)"
    monitor.take("a", 0.0)
    monitor.ignore("a", "stamps do not advance")
    assert monitor.find_fault(0.05) == ""
    assert monitor.find_fault(0.2) == "a stale: none for 100 ms (stamps do not advance)"


def test_wheels_and_suspension_may_come_in_messages_of_their_own_and_an_arm_changes_nothing():
    memory = JointMemory(FIXED)
    assert memory.time == NEVER
    assert memory.take(ANGLES, {}, 1.0)
    assert memory.describe_older(0.5) == f"no velocity of {', '.join(WHEEL_JOINTS)}"
    assert memory.take({}, RATES, 1.1)
    assert not memory.take({"arm_yaw": 1.0}, {"arm_yaw": 0.1}, 2.0)
    assert memory.time == 1.0 and memory.wheel_time == 1.1
    assert memory.suspension_angles == pytest.approx([0.1] * 4)
    assert memory.wheel_rates == pytest.approx([0.2] * 6)


def test_values_with_a_stamp_that_does_not_advance_are_not_taken():
    memory = JointMemory(FIXED)
    assert memory.take(ANGLES, RATES, 1.0, stamp=5)
    for stamp in (5, 4):
        assert not memory.take(ANGLES, RATES, 2.0, stamp=stamp)
    assert memory.time == 1.0
    assert memory.take(ANGLES, {}, 2.0, stamp=6) and memory.wheel_time == 1.0
    assert memory.take(ANGLES, RATES, 2.1) and not memory.take(ANGLES, RATES, 2.2, stamp=5)
    memory.forget()
    assert memory.time == NEVER
    assert memory.take(ANGLES, RATES, 3.0, stamp=2)


def test_rates_of_the_suspension_are_known_only_while_all_are_recent():
    memory = JointMemory(FIXED)
    memory.take(ANGLES, RATES | dict.fromkeys(SUSPENSION_JOINTS, 0.3), 1.0)
    assert memory.find_suspension_rates(0.9) == pytest.approx([0.3] * 4)
    memory.take({}, {"rocker_left": 0.4}, 1.2)
    assert memory.find_suspension_rates(1.1) is None


def test_a_measurement_was_before_its_arrival_by_its_age_and_stamps_advance_but_not_ahead():
    check = InputMonitor({})
    check.tolerance = 0.05
    assert check.find_time("imu", CLOCK + 40 * MILLISECOND, CLOCK, 7.0) == 7.0
    with pytest.raises(StampError, match="more than 50 ms ahead"):
        check.find_time("imu", CLOCK + 60 * MILLISECOND, CLOCK, 7.0)
    check.forget()
    assert check.find_time("imu", CLOCK - 30 * MILLISECOND, CLOCK, 7.0) == pytest.approx(6.97)
    assert check.find_time("imu", CLOCK - 3600 * NANOSECONDS, CLOCK, 7.0, merged=True) < -3500.0
    assert check.find_time("imu", 0, CLOCK, 7.1) == 7.1  # has no stamp
    check.find_time("imu", CLOCK, CLOCK, 7.0)
    for stamp in (CLOCK, CLOCK - MILLISECOND):
        with pytest.raises(StampError, match="do not advance"):
            check.find_time("imu", stamp, CLOCK, 7.0)
    assert check.find_time("cmd_vel", CLOCK, CLOCK, 7.0) == 7.0
    check.forget()
    assert check.find_time("imu", CLOCK - MILLISECOND, CLOCK, 7.0) == pytest.approx(6.999)


@pytest.mark.parametrize(("step", "text"), [(3600, "ahead"), (-1, "back")])
def test_a_step_of_the_system_clock_is_seen_at_once_and_passes(step, text):
    watch = ClockWatch(0.07)
    for k in range(5):
        assert watch.check(k * 0.02, CLOCK + k * 20 * MILLISECOND, False) == ""
    stepped = CLOCK + step * NANOSECONDS
    fault = watch.check(0.1, stepped + 100 * MILLISECOND, False)
    assert fault == f"the clock was stepped {text}" and watch.stepped
    assert watch.check(0.12, stepped + 120 * MILLISECOND, False) == "" and not watch.stepped
    later = stepped + 120 * MILLISECOND + 5 * NANOSECONDS
    assert watch.check(5.12, later, False) == ""  # a late update is no step


def test_a_simulated_clock_may_run_fast_or_slow_but_not_stop_or_go_back():
    watch = ClockWatch(0.07)
    for k, ticks in enumerate([0, 200, 400, 401, 402]):
        assert watch.check(k * 0.02, CLOCK + ticks * MILLISECOND, True) == ""
    for now in (0.1, 0.12):
        assert watch.check(now, CLOCK + 402 * MILLISECOND, True) == ""
    assert watch.check(0.14, CLOCK + 402 * MILLISECOND, True) == "/clock stands still"
    assert watch.check(0.18, CLOCK + 403 * MILLISECOND, True) == ""
    assert "back" in watch.check(0.20, CLOCK, True)
