# SPDX-License-Identifier: Apache-2.0
"""A rover that creeps is not stuck; one that stands while it pushes is, within 2 s."""

from dataclasses import fields, replace

import numpy as np
import pytest

from rover_planner.learning.stuck_watch import StuckWatch
from rover_planner.learning.wheel_slip import SlipWindow

SPEED, MAX_TORQUE, PERIOD, DURATION, DEVIATION = 0.06, 5.0, 0.1, 0.5, 0.02


def window(time: float, x: float, rolling: float, scrub: float = 0.0) -> SlipWindow:
    """Return a window at whose middle the wheels were at x."""
    told = {"time": time, "duration": DURATION, "deviation": DEVIATION, "excess": 0.0}
    told |= {"rolling": np.full(6, rolling), "scrub": np.full(6, scrub), "unsteadiness": 0.0}
    told |= {"places": np.tile([x, 0.0], (6, 1))}
    return SlipWindow(
        **dict.fromkeys((one.name for one in fields(SlipWindow)), np.zeros(6)) | told
    )


def first_notice(speed: float, rolling: float, torque: float, climb: float = 0.0) -> float | None:
    """Return when a rover that moves at a speed from 0 s on is first said to be stuck [s]."""
    watch = StuckWatch(SPEED, MAX_TORQUE)
    for time in PERIOD * np.arange(1, 100):
        x = speed * (time - 0.5 * DURATION)
        one = window(float(time), x, rolling)
        if watch.update(one, np.full(6, torque), climb):
            return float(time)
    return None


@pytest.mark.parametrize(("rolling", "torque"), [(SPEED, 1.0), (0.0, MAX_TORQUE)])
def test_a_rover_that_stands_while_its_wheels_turn_or_push_is_stuck_within_two_seconds(
    rolling, torque
):
    noticed = first_notice(0.0, rolling, torque)
    assert noticed is not None and noticed <= 2.0


def test_a_rover_that_creeps_rests_or_climbs_is_not_stuck():
    for rolling in (SPEED, 0.2 * SPEED):
        assert first_notice(0.2 * SPEED, rolling, MAX_TORQUE) is None
    assert first_notice(0.0, 0.0, 0.5) is None
    assert first_notice(0.0, SPEED, 1.0, climb=0.05) is None


def turn_on_the_spot(time: float) -> SlipWindow:
    around = 0.15 * time + np.arange(6.0)
    places = 0.4 * np.column_stack([np.cos(around), np.sin(around)])
    return replace(window(time, 0.0, SPEED), places=places)


def turn_back(time: float, turn: float = 3.05, back: float = 0.85) -> SlipWindow:
    after = np.clip((time - turn) / (0.5 * DURATION), -1.0, 1.0)
    share = back if after > 0.0 else 1.0
    return window(time, SPEED * share * abs(time - turn), SPEED * share * after)


def slide_back(time: float) -> SlipWindow:
    back = -0.3 * SPEED
    return replace(window(time, back * time, SPEED), travel=np.full(6, back))


@pytest.mark.parametrize(
    ("move", "commanded", "since"),
    [
        (turn_on_the_spot, None, np.inf),
        (turn_back, None, np.inf),
        (lambda time: window(time, 0.0, 0.2 * SPEED, scrub=0.25 * SPEED), None, np.inf),
        (slide_back, None, 1.25),
        (lambda time: window(time, 0.0, SPEED * (time >= 1.0)), SPEED, 1.25),
        (lambda time: window(time, 0.0, 0.0, scrub=0.014 * (time < 2.6)), SPEED, 3.75),
    ],
    ids=["on the spot", "turns back", "steers", "slides back", "spins late", "stops steering"],
)
def test_a_rover_is_stuck_from_when_it_stands_or_slides_back(move, commanded, since):
    watch = StuckWatch(SPEED, MAX_TORQUE)
    for time in PERIOD * np.arange(1, 60):
        stuck = watch.update(move(float(time)), np.ones(6), 0.0, commanded=commanded)
        assert stuck == (time > since)
