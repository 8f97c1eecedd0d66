# SPDX-License-Identifier: Apache-2.0
"""Poses that break a limit, whatever the path around them decides, and those that may."""

from rover_physics.numerics.kernels import exact_kernel
from rover_physics.prediction.drops import MIN_ANGLE, may_roll_off_edge
from rover_physics.prediction.path_kernels import angle_ahead
from rover_physics.results.uses import find_broken
from rover_physics.status import PoseStatus


@exact_kernel
def find_suspects(results, numbers, limits, wheels):
    """Return the first row that may break a limit, and the first that does so in any case; or -1.

    A wheel that rolls off an edge needs no equilibrium, so a row at which a wheel may do so may
    keep limits that it breaks. What the path around a row decides is not known yet.

    Args:
        results: (n,) RESULT.
        numbers: The same as numbers (n, RESULT_COLUMNS).
        limits: (k,) LIMIT.
        wheels: Wheels.
    """
    suspect = -1
    for row in range(results.size):
        broken, in_any_case = 0, 0
        if results[row].status == PoseStatus.SETTLED:
            broken, in_any_case = find_broken(numbers, row, limits)
        if broken >= 0:
            suspect = row if suspect < 0 else suspect
            if in_any_case >= 0 or not _path_decides(results[row], wheels):
                return suspect, row
    return suspect, -1


@exact_kernel
def _path_decides(result, wheels):
    """Return whether the path around a pose may decide that a wheel rolls off an edge there."""
    if not wheels.on_servos:
        return may_roll_off_edge(result, wheels)[0]
    steepest = 0.0
    for wheel in range(6):
        steepest = min(steepest, angle_ahead(result, wheel))
    return steepest < -MIN_ANGLE


@exact_kernel
def mark_failures(results, numbers, limits, wheels, fails):
    """Write True into fails (n,) for RESULTs (n,) that break a limit in any case."""
    for row in range(results.size):
        here = slice(row, row + 1)
        fails[row] = find_suspects(results[here], numbers[here], limits, wheels)[1] >= 0
