# SPDX-License-Identifier: Apache-2.0
"""What lasts is logged when it begins and ends; what repeats, once in a while."""

from rover_planner.ros.logs import REPEAT_PERIOD, RepeatLog, TransitionLog


class Lines(list):
    """A logger that keeps its lines."""

    warning = info = list.append


def test_a_condition_that_stays_is_told_once_and_its_end_once():
    lines = Lines()
    log = TransitionLog(lines)
    for k in range(1000):
        log.update("imu", "imu is nan" if k < 500 else "", "imu is back", 0.01 * k)
    assert lines == ["imu is nan", "imu is back"]


def test_one_that_flaps_is_told_once_a_second_at_most():
    lines = Lines()
    log = TransitionLog(lines)
    for k in range(1000):
        log.update("imu", "imu is nan" if k % 2 else "", "imu is back", 0.01 * k)
    assert 2 <= len(lines) <= 10


def test_one_that_ended_and_began_again_within_a_second_is_told_with_its_new_reason():
    lines = Lines()
    log = TransitionLog(lines)
    log.update("imu", "waiting for imu", "imu is back", 0.0)
    log.update("imu", "", "imu is back", 0.3)
    for k in range(5, 15):
        log.update("imu", "imu is nan", "imu is back", 0.1 * k)
    assert lines == ["waiting for imu", "imu is nan"]


def test_one_that_ended_before_it_could_be_told_is_told_with_its_end():
    lines = Lines()
    log = TransitionLog(lines)
    for time, reason in ((0.0, "waiting"), (1.5, ""), (1.6, "imu is nan"), (1.7, ""), (3.0, "")):
        log.update("imu", reason, "imu is back", time)
    assert lines == [
        "waiting", "imu is back", "imu is back; it was for less than 1 s: imu is nan"
    ]  # fmt: skip


def test_texts_that_differ_in_numbers_are_told_once_in_a_period_and_counted():
    log = RepeatLog()
    lines = [
        log.line(f"it is {age:.3f} s old", 0.1 * age) for age in range(int(30 * REPEAT_PERIOD))
    ]
    told = [line for line in lines if line]
    assert told == [
        "it is 0.000 s old",
        "it is 100.000 s old (99 more since the last line)",
        "it is 200.000 s old (99 more since the last line)",
    ]


def test_another_reason_is_told_at_once():
    log = RepeatLog()
    assert log.line("no frame 'odom'", 0.0) and log.line("no frame 'moon'", 0.0)
    assert log.line("no frame 'odom'", 1.0) == ""
