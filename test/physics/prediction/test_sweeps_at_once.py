# SPDX-License-Identifier: Apache-2.0
"""Sweeps in several threads do not wait for each other, and find what each finds alone."""

import threading
from contextlib import suppress
from dataclasses import replace

import numpy as np

from rover_physics.numerics.interruption import interruptible
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.rover_file import load_rover
from rover_physics.traversability.judge import judge_path
from support.grounds import make_terrain, rocky

ROVER = load_rover("lsr1")
ARRAYS = ("position", "wheel_loads", "tangential", "friction_utilisation", "rocker_angle")


def path_along(y, count=150):
    return np.column_stack([np.linspace(-2.5, 2.5, count), np.full(count, y), np.zeros(count)])


def test_sweeps_at_once_have_the_bits_of_sweeps_alone():
    exact = make_terrain(rocky)
    uncertain = replace(exact, elevation_std=np.full(exact.elevation.shape, 0.002))
    asked = [
        (terrain, path_along(y), SweepOptions(policy=policy))
        for terrain in (exact, uncertain)
        for y in (-0.5, 0.3)
        for policy in ("equal", "optimal")
    ]
    alone = [judge_path(ROVER, *one[:2], one[2]) for one in asked]
    found: dict[int, list] = {k: [] for k in range(len(asked))}

    def sweep(k):
        for _ in range(2):
            found[k].append(judge_path(ROVER, *asked[k][:2], asked[k][2]))

    threads = [threading.Thread(target=sweep, args=(k,)) for k in found]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for k, (prediction, verdict) in enumerate(alone):
        assert len(found[k]) == 2
        for other, other_verdict in found[k]:
            assert other_verdict == verdict or other_verdict.codes == verdict.codes
            for name in ARRAYS:
                np.testing.assert_array_equal(getattr(other, name), getattr(prediction, name))


def test_a_short_sweep_does_not_wait_for_the_end_of_a_long_one():
    terrain = make_terrain(rocky)
    begun, enough, ended = threading.Event(), threading.Event(), threading.Event()

    def check():
        begun.set()
        if enough.is_set():
            raise InterruptedError

    def sweep():
        with suppress(InterruptedError), interruptible(check):
            judge_path(ROVER, terrain, path_along(0.3, 400_000))
            ended.set()

    thread = threading.Thread(target=sweep)
    thread.start()
    assert begun.wait(20.0)
    for _ in range(3):
        judge_path(ROVER, terrain, path_along(0.0, 20))
    assert not ended.is_set()
    enough.set()
    thread.join()
