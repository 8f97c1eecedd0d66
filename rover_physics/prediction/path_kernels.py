"""Kernels over the waypoints of a path: contact jumps, and sums of distance, time and energy."""

from typing import Any, NamedTuple

import numpy as np

from rover_physics.numerics.kernels import exact_kernel
from rover_physics.status import PoseStatus

ANGLE_JUMP = np.radians(12.0)
"""Change of a contact angle [rad] above which it is a jump, if one of the two angles is steep."""
STEEP_CONTACT = np.radians(25.0)
"""Size of a contact angle [rad] above which the contact is steep."""


class JumpLimits(NamedTuple):
    """Limits that define a contact jump."""

    max_spacing: float
    """Largest distance of two waypoints between which jumps are searched [m]."""
    min_spacing: float
    """Length below which a piece is not divided further [m]."""
    height: float
    """Change of a wheel's height above which it is a jump [m]."""


class PathPoints(NamedTuple):
    """Poses along a path with their places on it and their results."""

    place: np.ndarray
    """(n,) place along the path in waypoints: 2.5 is halfway between waypoints 2 and 3."""
    waypoint: np.ndarray
    """(n,) index of the waypoint itself, or of the next one for a pose in between."""
    poses: np.ndarray
    """(n, 3) x, y [m], yaw [rad]."""
    results: Any
    """(n,) RESULT of each."""


@exact_kernel
def find_jumps(results, poses, joined, limits, ends):
    """Find the pairs of waypoints between which a contact jumps; return their number.

    Args:
        results: (n,) RESULT of each waypoint.
        poses: (n, 3) x, y [m] and yaw [rad] of the waypoints.
        joined: (n - 1,) True where a waypoint and the next one belong to the same path.
        limits: JumpLimits.
        ends: (>= n, 2) rows of the pairs, written.
    """
    count = 0
    for row in range(results.size - 1):
        if not (joined[row] and _jumps(results[row], results[row + 1], limits.height)):
            continue
        if 0.0 < _distance(poses[row], poses[row + 1]) <= limits.max_spacing:
            ends[count, 0], ends[count, 1] = row, row + 1
            count += 1
    return count


@exact_kernel
def divide_stretches(ends, pieces, known, new):
    """Divide stretches evenly and write the poses within them, stretch by stretch.

    Args:
        ends: (k, 2) rows of `known` at the start and end of each stretch.
        pieces: Number of pieces of a stretch.
        known: PathPoints.
        new: (place, waypoint, poses), each with k * (pieces - 1) rows, written.
    """
    place, waypoint, poses = known.place, known.waypoint, known.poses
    new_place, new_waypoint, new_poses = new
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
def sort_pieces(ends, pieces, known, limits, sorted_ends):
    """Find the pieces of stretches in which a contact still jumps; return how many open, closed.

    A piece is closed if it is shorter than `limits.min_spacing`, or if the rover does not settle
    at a pose within it. The other pieces are open.

    Args:
        ends: (k, 2) rows of `known` at the start and end of each stretch.
        pieces: Number of pieces of a stretch; the poses within the stretches are the last rows.
        known: PathPoints.
        limits: JumpLimits.
        sorted_ends: (2, >= k * pieces, 2) end rows of the open pieces, then of the closed ones,
            written.
    """
    results, poses = known.results, known.poses
    n_open, n_closed = 0, 0
    row = results.size - ends.shape[0] * (pieces - 1)
    for k in range(ends.shape[0]):
        before, skipped = ends[k, 0], False
        for i in range(pieces):
            after = row + i if i < pieces - 1 else ends[k, 1]
            if results[after].status == PoseStatus.NOT_SETTLED:
                skipped = True
                continue
            if _jumps(results[before], results[after], limits.height):
                if skipped or _distance(poses[before], poses[after]) < limits.min_spacing:
                    sorted_ends[1, n_closed, 0], sorted_ends[1, n_closed, 1] = before, after
                    n_closed += 1
                else:
                    sorted_ends[0, n_open, 0], sorted_ends[0, n_open, 1] = before, after
                    n_open += 1
            before, skipped = after, False
        row += pieces - 1
    return n_open, n_closed


@exact_kernel
def _distance(here, there):
    return np.hypot(there[0] - here[0], there[1] - here[1])


@exact_kernel
def _jumps(here, there, height_jump):
    if here.status != PoseStatus.SETTLED or there.status != PoseStatus.SETTLED:
        return False
    for wheel in range(6):
        angle, other = here.contact_angle[wheel], there.contact_angle[wheel]
        if max(abs(angle), abs(other)) > STEEP_CONTACT and abs(other - angle) > ANGLE_JUMP:
            return True
        if abs(there.wheel_centres[wheel, 2] - here.wheel_centres[wheel, 2]) > height_jump:
            return True
    return False


@exact_kernel
def add_up(poses, results, speed, start, sums):
    """Write distance [m], time [s] and energy [J] into sums (3, n); return those at the last pose.

    Args:
        poses: (n, 3) x, y [m] and yaw [rad].
        results: (n,) RESULT of each pose. Time and energy are NaN where it is not settled, and
            the climb between two poses counts only if both are settled.
        speed: Speed along the ground [m/s].
        start: Distance, time and energy at the first pose.
        sums: (3, n), written.
    """
    distance, time, energy = start
    for i in range(results.size):
        settled = results[i].status == PoseStatus.SETTLED
        if i > 0:
            step = _distance(poses[i - 1], poses[i])
            both = settled and results[i - 1].status == PoseStatus.SETTLED
            climb = results[i].q[0] - results[i - 1].q[0] if both else 0.0
            duration = np.hypot(step, climb) / speed
            distance += step
            time += duration
            energy += 0.5 * (_power(results[i]) + _power(results[i - 1])) * duration
        sums[0, i] = distance
        sums[1, i] = time if settled else np.nan
        sums[2, i] = energy if settled else np.nan
    return distance, time, energy


@exact_kernel
def _power(result):
    return result.power if result.status == PoseStatus.SETTLED else 0.0


@exact_kernel
def find_remaining_jumps(path, between, limits, ends):
    """Find the neighbours on a path whose contacts jump at one place; return their number.

    Args:
        path: PathPoints of the waypoints.
        between: PathPoints of the poses in between, no wheel held.
        limits: JumpLimits.
        ends: (>= n + m, 2) pairs of neighbours, written: waypoint i as i, pose j in between as
            n + j.
    """
    n, m = path.place.size, between.place.size
    count, last, j = 0, 0, 0
    for k in range(1, n + m):
        waypoint = k - j
        if j < m and between.place[j] < waypoint:
            here = n + j
            j += 1
        else:
            here = waypoint
        a = path.results[last] if last < n else between.results[last - n]
        b = path.results[here] if here < n else between.results[here - n]
        if _jumps(a, b, limits.height):
            apart = 0.0
            if last < n and here < n:
                apart = _distance(path.poses[last], path.poses[here])
            searched = last >= n or here >= n or apart > 0.0
            if searched and apart <= limits.max_spacing:
                ends[count, 0], ends[count, 1] = last, here
                count += 1
        last = here
    return count
