"""Frozen, delayed and future stamps do not pass as recent; a stepped or stopped clock is seen."""

import pytest

from rover_planner.traction.clock_watch import ClockWatch
from rover_planner.traction.stamps import NANOSECONDS, StampCheck, StampError

CLOCK = 1_000_000 * NANOSECONDS
MILLISECOND = NANOSECONDS // 1000


def test_the_time_of_a_measurement_is_its_arrival_less_its_age():
    check = StampCheck(0.05)
    assert check.find_time("imu", CLOCK - 30 * MILLISECOND, CLOCK, 7.0) == pytest.approx(6.97)
    assert check.find_time("imu", CLOCK - 3600 * NANOSECONDS, CLOCK, 7.0, merged=True) < -3500.0


def test_a_message_without_a_stamp_has_the_time_of_its_arrival():
    check = StampCheck(0.05)
    assert check.find_time("imu", 0, CLOCK, 7.0) == 7.0
    check.find_time("imu", CLOCK, CLOCK, 7.0)
    assert check.find_time("imu", 0, CLOCK, 7.1) == 7.1


def test_a_stamp_that_does_not_advance_is_refused_in_its_stream_only():
    check = StampCheck(0.05)
    check.find_time("imu", CLOCK, CLOCK, 7.0)
    for stamp in (CLOCK, CLOCK - MILLISECOND):
        with pytest.raises(StampError, match="do not advance"):
            check.find_time("imu", stamp, CLOCK, 7.0)
    assert check.find_time("cmd_vel", CLOCK, CLOCK, 7.0) == 7.0
    check.forget()
    assert check.find_time("imu", CLOCK - MILLISECOND, CLOCK, 7.0) == pytest.approx(6.999)


def test_a_stamp_from_the_future_is_refused_beyond_the_tolerance():
    check = StampCheck(0.05)
    assert check.find_time("imu", CLOCK + 40 * MILLISECOND, CLOCK, 7.0) == 7.0
    with pytest.raises(StampError, match="more than 50 ms ahead"):
        check.find_time("imu", CLOCK + 60 * MILLISECOND, CLOCK, 7.0)


@pytest.mark.parametrize(("step", "text"), [(-3600, "back"), (3600, "ahead"), (-1, "back")])
def test_a_step_of_the_system_clock_is_seen_at_once_and_passes(step, text):
    watch = ClockWatch(0.07)
    for k in range(5):
        assert watch.check(k * 0.02, CLOCK + k * 20 * MILLISECOND, False) == ""
    stepped = CLOCK + step * NANOSECONDS
    fault = watch.check(0.1, stepped + 100 * MILLISECOND, False)
    assert fault == f"the clock was stepped {text}" and watch.stepped
    assert watch.check(0.12, stepped + 120 * MILLISECOND, False) == "" and not watch.stepped


def test_a_late_update_is_no_step_of_the_clock():
    watch = ClockWatch(0.07)
    watch.check(0.0, CLOCK, False)
    assert watch.check(5.0, CLOCK + 5 * NANOSECONDS, False) == ""


def test_a_simulated_clock_may_run_fast_or_slow_but_not_stop_or_go_back():
    watch = ClockWatch(0.07)
    for k, ticks in enumerate([0, 200, 400, 401, 402]):
        assert watch.check(k * 0.02, CLOCK + ticks * MILLISECOND, True) == ""
    for now in (0.1, 0.12):
        assert watch.check(now, CLOCK + 402 * MILLISECOND, True) == ""
    assert watch.check(0.14, CLOCK + 402 * MILLISECOND, True) == "/clock stands still"
    assert watch.check(0.18, CLOCK + 403 * MILLISECOND, True) == ""
    assert "back" in watch.check(0.20, CLOCK, True)
