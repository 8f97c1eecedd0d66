"""Conditions are logged when they begin and end, at most one line a second about each."""

from rover_planner.ros.logs.transition_log import TransitionLog


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
