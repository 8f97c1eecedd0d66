"""Loops over the waypoints of a path: where contacts jump, and what adds up along the way."""

import numpy as np

from rover_physics.kernels import exact_kernel
from rover_physics.settling import NOT_SETTLED, SETTLED

ANGLE_JUMP = np.radians(12.0)
"""Change of a contact angle that is looked into, where one of the two is steep."""
STEEP = np.radians(25.0)


@exact_kernel
def find_jumps(results, run, height_jump, ends):
    """Find neighbours between which a contact jumps, and return how many there are.

    Args:
        results: (n,) RESULT, in runs of `run` rows along the path, one run after the other.
        run: Rows of a run; the last and the first of two runs are no neighbours, nor is a row in
            which the rover does not settle one: those before and after it are.
        height_jump: Change of a wheel's height [m] that is a jump.
        ends: (>= n, 2) where the rows of the neighbours are written to.
    """
    count, before = 0, -1
    for row in range(results.size):
        if row % run == 0:
            before = -1
        if results[row].status == NOT_SETTLED:
            continue
        if before >= 0 and _jumps(results[before], results[row], height_jump):
            ends[count, 0], ends[count, 1] = before, row
            count += 1
        before = row
    return count


@exact_kernel
def _jumps(here, there, height_jump):
    if here.status != SETTLED or there.status != SETTLED:
        return False
    for wheel in range(6):
        angle, other = here.contact_angle[wheel], there.contact_angle[wheel]
        if max(abs(angle), abs(other)) > STEEP and abs(other - angle) > ANGLE_JUMP:
            return True
        if abs(there.wheel_centres[wheel, 2] - here.wheel_centres[wheel, 2]) > height_jump:
            return True
    return False


@exact_kernel
def divide_stretches(place, poses):
    """Write evenly spaced places (k, p + 1) and poses (k, p + 1, 3) between the first and last."""
    pieces = place.shape[1] - 1
    for k in range(place.shape[0]):
        first, last = poses[k, 0], poses[k, pieces]
        turn = (last[2] - first[2] + np.pi) % (2.0 * np.pi) - np.pi
        for i in range(1, pieces):
            share = i / pieces
            place[k, i] = place[k, 0] + share * (place[k, pieces] - place[k, 0])
            poses[k, i, 0] = first[0] + share * (last[0] - first[0])
            poses[k, i, 1] = first[1] + share * (last[1] - first[1])
            poses[k, i, 2] = first[2] + share * turn


@exact_kernel
def add_up(poses, height, power, settled, speed, sums):
    """Write distance [m], time [s] and energy [J] since the first waypoint into sums (3, n).

    Only settled stretches take time and energy; both are NaN where the rover is not settled.
    """
    distance, time, energy = 0.0, 0.0, 0.0
    for i in range(height.size):
        if i > 0:
            step = np.hypot(poses[i, 0] - poses[i - 1, 0], poses[i, 1] - poses[i - 1, 1])
            climb = height[i] - height[i - 1] if settled[i] and settled[i - 1] else 0.0
            duration = np.hypot(step, climb) / speed
            before = power[i - 1] if settled[i - 1] else 0.0
            now = power[i] if settled[i] else 0.0
            distance += step
            time += duration
            energy += 0.5 * (now + before) * duration
        sums[0, i] = distance
        sums[1, i] = time if settled[i] else np.nan
        sums[2, i] = energy if settled[i] else np.nan
