# SPDX-License-Identifier: Apache-2.0
"""Poses along a path, and the kernels over them: contact jumps, distance, time and energy."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rover_physics.numerics.arrays import Floats, view_read_only
from rover_physics.numerics.kernels import exact_kernel
from rover_physics.results.record import join_results, new_results, select_results
from rover_physics.status import PoseStatus, TorquePolicy

LONGEST_STEP = 1.0 + 1e-6
"""Distance [wheel radii] of neighbours up to which it is looked at what lies between: a radius,
however the distance is rounded."""
HEIGHT_JUMP = 0.25
"""Change of a wheel's height between two poses [wheel radii] above which it is a jump."""
MIN_SPACING = 1e-3
"""Distance between poses [wheel radii] below which a jump counts as at one place."""
PEAK_SPACING, EDGE_SPACING = 0.01, 0.02
"""Distances [wheel radii] below which peaks of forces at a limit are not searched, and smaller
peaks and ends of falls. With 0.06 for smaller peaks, twice as many waypoints change 5 verdicts in
1,000, not 2, and rough ground costs less than 1 % less."""
ANGLE_JUMP = np.radians(12.0)
"""Change of a contact angle [rad] above which it is a jump, if one of the two angles is steep."""
JUMP_SPACING, MILD_USE = 0.07, 0.5
"""Distance [wheel radii] from which on the place of a jump does not matter where forces stay below
this share of their limits."""
STEEP_CONTACT = np.radians(25.0)
"""Size of a contact angle [rad] above which the contact is steep."""
FACE = np.radians(45.0)
"""Steepness [rad] of a contact behind a wheel from which a wheel falls anyway."""
PEAK, LEAST_USE = 2.5, 0.55
"""Rise of friction utilisation and torque saturation between two poses, over their value there and
per rad by which a contact turns, that is looked for, from this share of a limit on."""
NEAR_LIMIT, LEAST_TURN = 0.9, 0.02
"""Share of a limit from which any peak is looked for if a contact turns by that [rad]."""
ROUNDING = 1e-9
"""Descent [m] below which it counts as zero, and excess of a force limit that does."""
AT_LIMIT = 0.95
"""Share of a limit from which a peak is looked for at the smallest spacing."""


class Crossings(NamedTuple):
    """Poses between waypoints, or any poses along a path, in the order of the path."""

    place: np.ndarray
    """(m,) place along the path in waypoints: 2.5 is halfway between waypoints 2 and 3."""
    waypoint: np.ndarray
    """(m,) index of the waypoint that follows."""
    held: np.ndarray
    """(m, 6, 2) height [m] and contact angle [rad] of wheels that climb a face, NaN for
    others; the height is NaN at the foot, where the wheel does not yet touch the face."""
    poses: np.ndarray
    """(m, 3) x, y [m], yaw [rad]."""
    results: Any
    """(m,) RESULT of each pose."""

    @property
    def climbing(self) -> np.ndarray:
        """(m,) True where a wheel is held at a face."""
        return ~np.isnan(self.held[:, :, 1]).all(axis=1)

    @property
    def views(self) -> "Crossings":
        """The same poses as kernels take them: read-only."""
        return Crossings._make(map(view_read_only, self))

    def select(self, rows: Any) -> "Crossings":
        """Return the poses at row indices, in that order, or where a mask (m,) is True."""
        *places, results = self
        return Crossings._make([*(part[rows] for part in places), select_results(results, rows)])

    def in_order(self) -> "Crossings":
        """Return the poses in path order; at a waypoint, the stretch that ends there is first."""
        return self.select(np.lexsort((self.waypoint, self.place)))

    def order_among(self, waypoints: int) -> NDArray[np.int64]:
        """Return rows in path order: a waypoint as its index, pose j of these as waypoints + j."""
        return np.append(np.arange(waypoints), self.place).argsort(kind="stable")

    def between(self, first: int, end: int, start: int = 0) -> "Crossings":
        """Return the poses from waypoint `first` up to `end`, counted from `start` on."""
        rows = slice(*np.searchsorted(self.place, (first, end)))
        place, waypoint, *rest = (part[rows] for part in self)
        return Crossings(place + (start - first), waypoint + (start - first), *rest)

    def reversed(self, waypoints: int) -> "Crossings":
        """Return the poses as they lie on the reversed path of that many waypoints."""
        back = self.select(np.arange(len(self.place))[::-1])
        place, waypoint = (waypoints - 1) - back.place, waypoints - back.waypoint
        return back._replace(place=place, waypoint=waypoint)


def none_held(count: int) -> np.ndarray:
    """Return `held` (count, 6, 2) of poses at which no wheel climbs."""
    return np.full((count, 6, 2), np.nan)


NO_CROSSINGS = Crossings(
    np.empty(0), np.empty(0, np.int64), none_held(0), np.empty((0, 3)), new_results(0)
)


def join_crossings(parts: Sequence[Crossings]) -> Crossings:
    """Return the rows of all parts, one after the other; a single part itself."""
    some = [part for part in parts if len(part.place)]
    if len(some) <= 1:
        return some[0] if some else NO_CROSSINGS
    *places, results = zip(*some, strict=True)
    return Crossings._make([*map(np.concatenate, places), join_results(results)])


@exact_kernel
def force_limit(limit, kept_share):
    """Return the friction utilisation or torque saturation up to which forces balance.

    Forces beyond what friction and motors give never balance, whatever the safety `limit`, of
    which a control margin leaves the `kept_share`.
    """
    return min(limit * kept_share, 1.0) + ROUNDING


@exact_kernel
def find_jumps(models, results, poses, joined, ends):
    """Find the neighbours between which a contact jumps or a limit may be passed; return how many.

    Args:
        models: (1,) MODEL, or more, of which the first counts.
        results: (n,) RESULT of each waypoint.
        poses: (n, 3) x, y [m] and yaw [rad] of the waypoints.
        joined: (n - 1,) True where a waypoint and the next one belong to the same path.
        ends: (>= n, 2) rows of the pairs, written.
    """
    model, count = models[0], 0
    linkage = model.linkage
    for row in range(results.size - 1):
        if not joined[row]:
            continue
        distance = distance_between(poses[row], poses[row + 1], linkage.swing_radius)
        if not 0.0 < distance <= LONGEST_STEP * linkage.radius:
            continue
        if wanted_spacing(model, results[row], results[row + 1]) < distance:
            ends[count, 0], ends[count, 1] = row, row + 1
            count += 1
    return count


@exact_kernel
def wanted_spacing(model, here, there):
    """Return the distance [m] up to which two poses tell what is between them; inf for any."""
    if here.status != PoseStatus.SETTLED or there.status != PoseStatus.SETTLED:
        return np.inf
    if not jumps_between(model, here, there):
        return _finest(model, here, there)
    return (MIN_SPACING if _decides(model, here, there) else JUMP_SPACING) * model.linkage.radius


@exact_kernel
def distance_between(here, there, swing_radius):
    """Return the distance [m] from a pose to another: of the body or, if it turns, of a wheel.

    `swing_radius` is the distance [m] of the outermost wheel from the body origin.
    """
    distance = np.hypot(there[0] - here[0], there[1] - here[1])
    return max(distance, swing_radius * abs(turn_between(here, there)))


@exact_kernel
def turn_between(here, there):
    """Return the turn [rad] from a pose to another, from -pi to below pi."""
    if there[2] == here[2]:
        return 0.0
    return (there[2] - here[2] + np.pi) % (2.0 * np.pi) - np.pi


def steps_between(here: np.ndarray, there: np.ndarray) -> Floats:
    """Return the steps (n, 3) from poses to others: x, y [m] and the shorter turn [rad]."""
    steps = np.asarray(there - here)
    steps[:, 2] = (steps[:, 2] + np.pi) % (2.0 * np.pi) - np.pi
    return steps


def distances_between(swing_radius: float, poses: np.ndarray) -> Floats:
    """Return the distances (n - 1,) between poses [m], as `distance_between` does."""
    steps = steps_between(poses[:-1], poses[1:])
    swing = swing_radius * np.abs(steps[:, 2])
    return np.maximum(np.hypot(steps[:, 0], steps[:, 1]), swing)


@exact_kernel
def angle_ahead(result, wheel):
    """Return the contact angle [rad] of a wheel, positive where it rolls to."""
    angle = result.contact_angle[wheel]
    return -angle if result.wheel_speed[wheel] < 0.0 else angle


@exact_kernel
def jumps_between(model, here, there):
    """Return whether a wheel's height or a steep contact jumps between two settled poses."""
    if here.status != PoseStatus.SETTLED or there.status != PoseStatus.SETTLED:
        return False
    for wheel in range(6):
        angle, other = here.contact_angle[wheel], there.contact_angle[wheel]
        if max(abs(angle), abs(other)) > STEEP_CONTACT and abs(other - angle) > ANGLE_JUMP:
            return True
        rise = there.wheel_centres[wheel, 2] - here.wheel_centres[wheel, 2]
        if abs(rise) > HEIGHT_JUMP * model.linkage.radius:
            return True
    return False


@exact_kernel
def _decides(model, here, there):
    """Return whether a verdict may depend on where between two close poses a contact jumps.

    It does where a wheel climbs or may fall, or forces are not far from their limits.
    """
    if model.settings.policy == TorquePolicy.SERVO:
        return True
    if max(_largest_use(model, here), _largest_use(model, there)) > MILD_USE:
        return True
    for wheel in range(6):
        rise = there.wheel_centres[wheel, 2] - here.wheel_centres[wheel, 2]
        ahead = -1.0 if there.wheel_speed[wheel] < 0.0 else 1.0
        behind = min(ahead * here.contact_angle[wheel], ahead * there.contact_angle[wheel])
        if abs(rise) > HEIGHT_JUMP * model.linkage.radius or behind < -FACE:
            return True
    return False


@exact_kernel
def _finest(model, here, there):
    """Return the spacing [m] for a stretch in which a limit may be passed, else inf; both settle.

    Forces change as contacts turn, and may peak while they do. Where they are beyond at one of the
    poses, a wheel may fall there; until it does, they count. Where a fall begins or ends between
    the poses, its place counts.
    """
    turn, passes_edge = 0.0, False
    for wheel in range(6):
        angle, other = here.contact_angle[wheel], there.contact_angle[wheel]
        turn = max(turn, abs(other - angle))
        ahead = -1.0 if there.wheel_speed[wheel] < 0.0 else 1.0
        passes_edge = passes_edge or (ahead * angle < -FACE) != (ahead * other < -FACE)
    use, other_use = 0.0, 0.0
    if model.settings.policy != TorquePolicy.SERVO:
        use, other_use = _largest_use(model, here), _largest_use(model, there)
    largest = max(use, other_use)
    rises = largest > LEAST_USE and largest * (1.0 + PEAK * turn) > 1.0
    if min(use, other_use) <= 1.0 and (rises or (largest > NEAR_LIMIT and turn > LEAST_TURN)):
        return (PEAK_SPACING if largest > AT_LIMIT else EDGE_SPACING) * model.linkage.radius
    return EDGE_SPACING * model.linkage.radius if passes_edge else np.inf


@exact_kernel
def _largest_use(model, result):
    """Return the largest share of what balances that friction and torque of a wheel use."""
    use, kept = 0.0, result.kept_share
    most_friction = force_limit(model.settings.friction_limit, kept)
    most_torque = force_limit(model.settings.torque_limit, kept)
    for wheel in range(6):
        friction = result.friction_utilisation[wheel] / most_friction
        torque = result.torque_saturation[wheel] / most_torque
        use = max(use, friction, torque)
    return use


@exact_kernel
def add_up(models, poses, results, start, sums):
    """Write distance [m], time [s] and energy [J] into sums (3, n); return those at the last pose.

    The rover drives from pose to pose with the motion of the later one. If steering to its angles
    takes longer than that, the drive waits.

    Args:
        models: (1,) MODEL, or more, of which the first counts.
        poses: (n, 3) x, y [m] and yaw [rad].
        results: (n,) RESULT of each pose. Time and energy are NaN where it is not settled, and
            climb and energy between two poses count only if both are settled.
        start: Distance, time and energy at the first pose.
        sums: (3, n), written.
    """
    model, (distance, time, energy) = models[0], start
    for i in range(results.size):
        result = results[i]
        settled = result.status == PoseStatus.SETTLED
        if i > 0:
            before = results[i - 1]
            here, there = poses[i - 1], poses[i]
            step = np.hypot(there[0] - here[0], there[1] - here[1])
            both = settled and before.status == PoseStatus.SETTLED
            climb = result.q[0] - before.q[0] if both else 0.0
            turn = turn_between(here, there)
            duration = _drive_time(step, climb, turn, result.motion)
            duration /= 0.5 * (_speed_share(result) + _speed_share(before))
            distance += step
            time += max(duration, _largest_change(before, result) / model.linkage.steering_rate)
            if both:
                energy += _work(model, before, result, here[2], turn, duration)
        sums[0, i] = distance
        sums[1, i] = time if settled else np.nan
        sums[2, i] = energy if settled else np.nan
    return distance, time, energy


@exact_kernel
def bulge(turn):
    """Return the length of an arc over that of its chord; `turn` is its angle [rad]."""
    half = 0.5 * abs(turn)
    return half / np.sin(half) if half > 1e-8 else 1.0


@exact_kernel
def _drive_time(step, climb, turn, motion):
    """Return the time [s] of a step [m] with a climb [m] and a turn [rad]."""
    speed, rate = np.hypot(motion[0], motion[1]), motion[2]
    if speed == 0.0:
        return abs(turn / rate)
    if rate != 0.0:
        step *= bulge(turn)
    return np.hypot(step, climb) / speed


@exact_kernel
def _largest_change(before, after):
    """Return the largest change of a steering angle [rad] between two RESULTs."""
    largest = 0.0
    for wheel in range(6):
        change = abs(after.steering_angle[wheel] - before.steering_angle[wheel])
        largest = max(largest, change)
    return largest


@exact_kernel
def _work(model, before, after, yaw, turn, duration):
    """Return the energy [J] of the wheels that drive from a RESULT to the next, both settled.

    A motor turns its wheel against the link that carries it, and the links turn, too.

    Args:
        model: MODEL.
        before: RESULT.
        after: RESULT with the motion of the step.
        yaw: Yaw before the step [rad].
        turn: Turn on it [rad].
        duration: Its time [s].
    """
    linkage, settings = model.linkage, model.settings
    roll, pitch = 0.5 * (before.q[1] + after.q[1]), 0.5 * (before.q[2] + after.q[2])
    about_x = after.q[1] - before.q[1] - turn * np.sin(pitch)
    about_y = (after.q[2] - before.q[2]) * np.cos(roll) + turn * np.sin(roll) * np.cos(pitch)
    energy = 0.0
    for wheel in range(6):
        rate = after.wheel_speed[wheel]
        if rate == 0.0:
            continue
        direction = -1.0 if rate < 0.0 else 1.0
        steering = after.steering_angle[wheel]
        heading = yaw + 0.5 * turn + steering
        centre, last = after.wheel_centres[wheel], before.wheel_centres[wheel]
        x, y, climb = centre[0] - last[0], centre[1] - last[1], centre[2] - last[2]
        level = bulge(turn) * abs(np.cos(heading) * x + np.sin(heading) * y)
        # A wheel that goes down more steeply than 45 degrees falls.
        way = np.hypot(level, climb) if climb > -level else level
        joints = _link_angle(linkage, after, wheel) - _link_angle(linkage, before, wheel)
        swing = np.cos(steering) * (about_y + joints) - np.sin(steering) * about_x
        spin = max(way / linkage.radius - direction * swing, 0.0)
        # A wheel about which the rover turns may slip as good as wholly; servos turn none faster
        # than told.
        on_servos = settings.policy == TorquePolicy.SERVO
        fastest = abs(rate) if on_servos else settings.max_wheel_speed
        most = max(spin, fastest * duration)
        for result in (before, after):
            slip = result.slip_ratio[wheel]
            spun = min(spin / (1.0 - slip), most) if slip < 1.0 else most
            energy += 0.5 * max(direction * result.torque[wheel], 0.0) * spun
    return energy


@exact_kernel
def _link_angle(linkage, result, wheel):
    """Return the angle [rad] of the link that carries a wheel to the body."""
    rocker = result.rocker_angle[wheel // 3]
    bogie = result.q[4 + wheel // 3] if linkage.on_bogie[wheel] else 0.0
    return rocker + bogie


@exact_kernel
def _speed_share(result):
    """Return the share of the nominal speed at a pose; 1 where none is known."""
    share = result.speed_share
    return share if result.status == PoseStatus.SETTLED and share > 0.0 else 1.0


@exact_kernel
def find_remaining_jumps(models, path, order, waypoints, ends):
    """Find the neighbours on a path whose contacts jump at one place; return their number.

    Args:
        models: (1,) MODEL, or more, of which the first counts.
        path: Crossings of the waypoints, then those in between, no wheel held.
        order: (n,) its rows in path order.
        waypoints: Number of waypoints.
        ends: (>= n, 2) pairs of neighbours, written.
    """
    model, count = models[0], 0
    linkage = model.linkage
    for k in range(1, order.size):
        last, here = order[k - 1], order[k]
        if not jumps_between(model, path.results[last], path.results[here]):
            continue
        apart = distance_between(path.poses[last], path.poses[here], linkage.swing_radius)
        if max(last, here) >= waypoints or 0.0 < apart <= LONGEST_STEP * linkage.radius:
            ends[count, 0], ends[count, 1] = last, here
            count += 1
    return count
