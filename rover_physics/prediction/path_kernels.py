"""Loops over the waypoints of a path: where contacts jump, and what adds up along the way."""

from typing import Any, NamedTuple

import numpy as np

from rover_physics.numerics.kernels import exact_kernel
from rover_physics.status import PoseStatus

ANGLE_JUMP = np.radians(12.0)
"""Change of a contact angle that is looked into, where one of the two is steep."""
STEEP_CONTACT = np.radians(25.0)


class JumpLimits(NamedTuple):
    """What counts as a jump of a contact."""

    max_spacing: float
    """Largest distance [m] of waypoints between which jumps are looked for."""
    min_spacing: float
    """Length [m] below which a piece is no longer divided."""
    height: float
    """Change of a wheel's height [m] that is a jump."""


class PathPoints(NamedTuple):
    """Poses along a path with their results, and where on the path they are."""

    place: np.ndarray
    """(n,) place along the path, counted in waypoints."""
    waypoint: np.ndarray
    """(n,) index of the waypoint that each belongs to, or that follows."""
    poses: np.ndarray
    """(n, 3) x, y [m], yaw [rad]."""
    results: Any
    """(n,) RESULT of each."""


@exact_kernel
def find_jumps(results, poses, joined, limits, ends):
    """Find the waypoints between which a contact jumps, and return how many pairs there are.

    Args:
        results: (n,) RESULTs of the waypoints.
        poses: (n, 3) their poses.
        joined: (n - 1,) True where the path leads from a waypoint to the next one.
        limits: JumpLimits.
        ends: (>= n, 2) where the pairs are written to.
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
    """Write what lies evenly between two rows each into the rows of `new`, stretch by stretch.

    Args:
        ends: (k, 2) rows of `known` between which the stretches lie.
        pieces: Into how many each is divided.
        known: PathPoints.
        new: (place, waypoint, poses) of k * (pieces - 1) rows, to be written.
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
    """Find the pieces of stretches within which a contact still jumps; return how many of both.

    Closed are pieces shorter than the least spacing, and those that hold a pose in which the
    rover does not settle; the others are open.

    Args:
        ends: (k, 2) rows between which the stretches lie.
        pieces: Into how many each was divided; the rows between the ends are the last ones.
        known: PathPoints.
        limits: JumpLimits.
        sorted_ends: (2, >= k * pieces, 2) where the rows of open pieces, then those of closed
            ones are written to.
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
def add_up(poses, results, speed, sums):
    """Write distance [m], time [s] and energy [J] since the first waypoint into sums (3, n).

    Only settled stretches take time and energy; both are NaN where the rover is not settled.
    """
    distance, time, energy = 0.0, 0.0, 0.0
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


@exact_kernel
def _power(result):
    return result.power if result.status == PoseStatus.SETTLED else 0.0
