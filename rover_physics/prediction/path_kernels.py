"""Loops over the waypoints of a path: where contacts jump, and what adds up along the way."""

import numpy as np

from rover_physics.contact.settling import NOT_SETTLED, SETTLED
from rover_physics.numerics.kernels import exact_kernel

ANGLE_JUMP = np.radians(12.0)
"""Change of a contact angle that is looked into, where one of the two is steep."""
STEEP = np.radians(25.0)


@exact_kernel
def find_jumps(results, poses, joined, longest, height_jump, ends):
    """Find the waypoints between which a contact jumps, and return how many pairs there are.

    Args:
        results: (n,) RESULTs of the waypoints.
        poses: (n, 3) their poses.
        joined: (n - 1,) True where the path leads from a waypoint to the next one.
        longest: Largest distance [m] of waypoints between which jumps are looked for.
        height_jump: Change of a wheel's height [m] that is a jump.
        ends: (>= n, 2) where the pairs are written to.
    """
    count = 0
    for row in range(results.size - 1):
        if not (joined[row] and _jumps(results[row], results[row + 1], height_jump)):
            continue
        if 0.0 < _distance(poses[row], poses[row + 1]) <= longest:
            ends[count, 0], ends[count, 1] = row, row + 1
            count += 1
    return count


@exact_kernel
def divide_stretches(ends, pieces, place, waypoint, poses, new_place, new_waypoint, new_poses):
    """Write what lies evenly between the ends (k, 2), rows of place, waypoint and poses.

    The new rows are `pieces` - 1 for each stretch, stretch by stretch.
    """
    row = 0
    for k in range(ends.shape[0]):
        before, after = ends[k, 0], ends[k, 1]
        first, last = poses[before], poses[after]
        turn = (last[2] - first[2] + np.pi) % (2.0 * np.pi) - np.pi
        for i in range(1, pieces):
            share = i / pieces
            new_place[row] = place[before] + share * (place[after] - place[before])
            new_waypoint[row] = waypoint[before]
            new_poses[row, 0] = first[0] + share * (last[0] - first[0])
            new_poses[row, 1] = first[1] + share * (last[1] - first[1])
            new_poses[row, 2] = first[2] + share * turn
            row += 1


@exact_kernel
def sort_pieces(ends, pieces, results, poses, height_jump, shortest, open_ends, closed_ends):
    """Find the pieces of stretches within which a contact still jumps; return how many of both.

    Closed are pieces shorter than `shortest` [m], and those that hold a pose in which the rover
    does not settle; the others are open.

    Args:
        ends: (k, 2) rows between which the stretches lie.
        pieces: Into how many each was divided; the rows between the ends are the last ones.
        results: (n,) RESULTs.
        poses: (n, 3) poses.
        height_jump: Change of a wheel's height [m] that is a jump.
        shortest: Length [m] below which a piece is closed.
        open_ends: (>= k * pieces, 2) where the rows of open pieces are written to.
        closed_ends: The same for closed ones.
    """
    n_open, n_closed = 0, 0
    row = results.size - ends.shape[0] * (pieces - 1)
    for k in range(ends.shape[0]):
        before, skipped = ends[k, 0], False
        for i in range(pieces):
            after = row + i if i < pieces - 1 else ends[k, 1]
            if results[after].status == NOT_SETTLED:
                skipped = True
                continue
            if _jumps(results[before], results[after], height_jump):
                if skipped or _distance(poses[before], poses[after]) < shortest:
                    closed_ends[n_closed, 0], closed_ends[n_closed, 1] = before, after
                    n_closed += 1
                else:
                    open_ends[n_open, 0], open_ends[n_open, 1] = before, after
                    n_open += 1
            before, skipped = after, False
        row += pieces - 1
    return n_open, n_closed


@exact_kernel
def _distance(here, there):
    return np.hypot(there[0] - here[0], there[1] - here[1])


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
def add_up(poses, results, speed, sums):
    """Write distance [m], time [s] and energy [J] since the first waypoint into sums (3, n).

    Only settled stretches take time and energy; both are NaN where the rover is not settled.
    """
    distance, time, energy = 0.0, 0.0, 0.0
    for i in range(results.size):
        settled = results[i].status == SETTLED
        if i > 0:
            step = _distance(poses[i - 1], poses[i])
            both = settled and results[i - 1].status == SETTLED
            climb = results[i].q[0] - results[i - 1].q[0] if both else 0.0
            duration = np.hypot(step, climb) / speed
            distance += step
            time += duration
            energy += 0.5 * (_power(results[i]) + _power(results[i - 1])) * duration
        sums[0, i] = distance
        sums[1, i] = time if settled else np.nan
        sums[2, i] = energy if settled else np.nan


@exact_kernel
def _power(result):
    return result.power if result.status == SETTLED else 0.0
