# SPDX-License-Identifier: Apache-2.0
"""An independent model of the rover for tests: geometry and balance of forces in plain numpy.

It shares no code with the kernels. It follows the conventions (docs/conventions.md) and the
equations of the paper.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from rover_physics import PathPrediction, Rover, Terrain
from rover_physics.rover.rover_file import rover_from_dict, rover_to_dict

UP = np.array([0.0, 0.0, 1.0])
GAP = 3e-5
"""What a settled pose of the rover lsr1 may leave open [m]."""
ANGLE = 4.0 * GAP / 0.4
"""What that may turn [rad]."""


@dataclass(frozen=True)
class Placed:
    """One settled rover, map frame, right side first."""

    attitude: np.ndarray
    """(3, 3) body to map."""
    origin: np.ndarray
    """(3,) body origin [m]."""
    wheels: np.ndarray
    """(6, 3) wheel centres, computed from the suspension angles [m]."""
    axles: np.ndarray
    """(6, 3) axles of the wheels, each turned about the z axis of its link."""
    rocker_pivots: np.ndarray
    """(2, 3) [m]."""
    bogie_pivots: np.ndarray
    """(2, 3) [m]."""
    on_bogie: np.ndarray
    """(6,) bool."""
    masses: list
    """All parts: (mass [kg], place [m], side 0, 1 or None, whether on the bogie)."""


def attitude_of(prediction: PathPrediction, i: int) -> np.ndarray:
    """Return R = Rz(yaw) Ry(pitch) Rx(roll) of waypoint i."""
    angles = [prediction.poses[i, 2], prediction.pitch[i], prediction.roll[i]]
    return Rotation.from_euler("ZYX", angles).as_matrix()


def place_rover(rover: Rover, prediction: PathPrediction, i: int) -> Placed:
    """Return the positions of the parts at waypoint i, from pose and suspension angles only."""
    R, origin = attitude_of(prediction, i), prediction.position[i]
    suspension, masses = rover.suspension, rover.masses
    wheels, axles, on_bogie, rocker_pivots, bogie_pivots = [], [], [], [], []
    parts = [(masses.body.mass, R @ np.array(masses.body.com) + origin, None, False)]
    for side, mirror in enumerate((np.array([1, -1, 1.0]), np.ones(3))):
        angle = prediction.rocker_angle[i, side]
        rocker_turn = Rotation.from_rotvec([0.0, angle, 0.0])
        bogie_turn = Rotation.from_rotvec([0.0, angle + prediction.bogie_angle[i, side], 0.0])
        rocker_pivot, level = mirror * suspension.rocker_pivot, mirror * suspension.bogie_pivot
        bogie_pivot = rocker_pivot + rocker_turn.apply(level - rocker_pivot)
        links = (rocker_turn, rocker_pivot, rocker_pivot), (bogie_turn, level, bogie_pivot)

        def place(point, carried, links=links, mirror=mirror):
            turn, before, now = links[carried]
            return R @ (now + turn.apply(mirror * np.array(point) - before)) + origin

        for name in ("rear", "middle", "front"):
            carried = name != suspension.rocker_wheel
            steered = Rotation.from_rotvec([0.0, 0.0, prediction.steering_angle[i, len(wheels)]])
            axles.append(R @ (links[carried][0] * steered).apply([0.0, 1.0, 0.0]))
            wheels.append(place(suspension.wheels[name], carried))
            on_bogie.append(carried)
            parts.append((rover.wheel.mass, wheels[-1], side, carried))
        for part, carried in ((masses.rocker, False), (masses.bogie, True)):
            parts.append((part.mass, place(part.com, carried), side, carried))
        rocker_pivots.append(R @ rocker_pivot + origin)
        bogie_pivots.append(R @ bogie_pivot + origin)
    return Placed(
        R, origin, np.array(wheels), np.array(axles), np.array(rocker_pivots),
        np.array(bogie_pivots), np.array(on_bogie), parts,
    )  # fmt: skip


def contact_frames(a: np.ndarray, contact_angle: np.ndarray) -> np.ndarray:
    """Return the unit vectors n, t, a of each wheel (6, 3, 3) from axles (6, 3) and angles (6,).

    n is the contact normal, a the wheel axis, t = a x n.
    """
    ahead = np.cross(a, UP) / np.linalg.norm(np.cross(a, UP), axis=1)[:, None]
    upward = np.cross(ahead, a)
    angle = contact_angle[:, None]
    n = np.cos(angle) * upward - np.sin(angle) * ahead
    return np.stack([n, np.cross(a, n), a], axis=1)


def balance_sums(rover: Rover, placed: Placed, acting: list) -> np.ndarray:
    """Return the nine sums that are zero in equilibrium, in units of the weight.

    Three forces and three moments about the body origin of the whole rover, the moment about each
    bogie pivot (eq 15), and the difference of the moments about the rocker pivots (eq 14 for both
    sides). Moments are divided by weight and wheelbase. Each force that is `acting` is told with
    its position: (force [N], position [m], side, whether on the bogie).
    """
    axis = placed.attitude[:, 1]

    def moment(pivot, side=None, bogie_only=False):
        about = (
            np.cross(point - pivot, force)
            for force, point, its_side, on_bogie in acting
            if side in (None, its_side) and (on_bogie or not bogie_only)
        )
        return sum(about, start=np.zeros(3))

    total_force = sum((force for force, *_ in acting), start=np.zeros(3))
    total_moment = moment(placed.origin)
    about_bogies = [axis @ moment(placed.bogie_pivots[k], k, bogie_only=True) for k in range(2)]
    about_rockers = [axis @ moment(placed.rocker_pivots[k], k) for k in range(2)]
    wheels = rover.suspension.wheels
    base = wheels["front"][0] - wheels["rear"][0]
    moments = [*total_moment, *about_bogies, about_rockers[0] - about_rockers[1]]
    return np.array([*total_force, *(np.array(moments) / base)]) / rover.weight


def _on_wheels(prediction: PathPrediction, i: int, placed: Placed, forces: np.ndarray) -> list:
    points = prediction.contact_points[i]
    return [(forces[k], points[k], k // 3, placed.on_bogie[k]) for k in range(6)]


def _weights(rover: Rover, placed: Placed) -> list:
    g = rover.gravity * UP
    return [(-mass * g, point, side, bogie) for mass, point, side, bogie in placed.masses]


def balance_residuals(rover: Rover, prediction: PathPrediction, i: int) -> np.ndarray:
    """Return the residuals of the nine balance equations of waypoint i; see `balance_sums`."""
    placed = place_rover(rover, prediction, i)
    shares = [prediction.wheel_loads[i], prediction.tangential[i], prediction.lateral[i]]
    frames = contact_frames(placed.axles, prediction.contact_angle[i])
    forces = np.einsum("kw,wkx->wx", np.array(shares), frames)
    acting = _on_wheels(prediction, i, placed, forces) + _weights(rover, placed)
    return balance_sums(rover, placed, acting)


def balance_matrix(
    rover: Rover, prediction: PathPrediction, i: int, shared: bool = True
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return A (9, 12 + k), b (9,) and the lateral shares (6, k) of waypoint i.

    A @ (N, T, s) = b is its balance, with forces in units of the weight and lateral forces
    S = shares @ s, which are s0 + s1 * position along the body where `shared`, else independent.
    """
    placed = place_rover(rover, prediction, i)
    frames = contact_frames(placed.axles, prediction.contact_angle[i])
    sums = []
    for kind in range(3):
        for wheel in range(6):
            forces = np.zeros((6, 3))
            forces[wheel] = rover.weight * frames[wheel, kind]
            acting = _on_wheels(prediction, i, placed, forces)
            sums.append(balance_sums(rover, placed, acting))
    A, b = np.array(sums).T, -balance_sums(rover, placed, _weights(rover, placed))
    along = (placed.wheels - placed.origin) @ placed.attitude[:, 0]
    shares = np.column_stack([np.ones(6), along]) if shared else np.eye(6)
    return np.hstack([A[:, :12], A[:, 12:] @ shares]), b, shares


COARSE_ANGLES, COARSE_ACROSS = 241, 33
"""Points along and across a wheel in the first look of `wheel_gaps`."""
STARTS, REFINEMENTS = 30, 7
"""Nearest points that are refined, and how often the spacing is divided by three."""


def wheel_gaps(rover: Rover, terrain: Terrain, prediction: PathPrediction, i: int) -> np.ndarray:
    """Return the smallest vertical gap (6,) [m] between each wheel's lower half and the ground.

    The whole width of the wheels of waypoint i is looked at, densely, then around the nearest
    points.
    """
    wheels = zip(prediction.wheel_centres[i], place_rover(rover, prediction, i).axles, strict=True)
    return np.array([wheel_gap(rover, terrain, centre, axis) for centre, axis in wheels])


def wheel_gap(rover: Rover, terrain: Terrain, centre: np.ndarray, axis: np.ndarray) -> float:
    """Return the smallest vertical gap [m] of a wheel with a centre (3,) and an axle (3,)."""
    half = 0.5 * rover.wheel.width
    ahead = np.cross(axis, UP) / np.linalg.norm(np.cross(axis, UP))
    upward = np.cross(ahead, axis)

    def gaps_at(angle: np.ndarray, across: np.ndarray) -> np.ndarray:
        rim = np.sin(angle)[..., None] * ahead - np.cos(angle)[..., None] * upward
        points = centre + rover.wheel.radius * rim + across[..., None] * axis
        heights = terrain.elevation_at(points[..., 0], points[..., 1])
        return np.where(np.isnan(heights), np.inf, points[..., 2] - heights)

    most = np.array([[0.5 * np.pi], [half]])
    steps = np.array([np.pi / (COARSE_ANGLES - 1), 2.0 * half / (COARSE_ACROSS - 1)])
    grid = np.meshgrid(
        np.linspace(-0.5 * np.pi, 0.5 * np.pi, COARSE_ANGLES),
        np.linspace(-half, half, COARSE_ACROSS),
    )
    places = np.stack([part.ravel() for part in grid])
    gaps = gaps_at(*places)
    best = places[:, np.argsort(gaps)[:STARTS]]
    around = np.stack([part.ravel() for part in np.meshgrid(*2 * [np.linspace(-1.0, 1.0, 9)])])
    for _ in range(REFINEMENTS):
        near = best[:, :, None] + steps[:, None, None] * around[:, None, :]
        near = np.clip(near, -most[..., None], most[..., None])
        gaps = gaps_at(*near)
        nearest = gaps.argmin(axis=1)
        best = near[:, np.arange(STARTS), nearest]
        steps = steps / 3.0
    return float(gaps.min())


def turned_round(rover: Rover) -> Rover:
    """Return the same rover with front and rear exchanged, without an arm."""
    name = f"{rover.name}_turned_round"
    contents = rover_to_dict(replace(rover, name=name, manipulator=None))
    suspension, belly = contents["suspension"], contents["belly"]
    wheels = suspension["wheels"]
    parts = [contents["masses"][name]["com"] for name in ("body", "rocker", "bogie")]
    for place in (suspension["rocker_pivot"], suspension["bogie_pivot"], *wheels.values(), *parts):
        place[0] = -place[0]
    for ends in (suspension["rocker_limits"], suspension["bogie_limits"], belly["x"]):
        ends[:] = -ends[1], -ends[0]
    wheels["rear"], wheels["front"] = wheels["front"], wheels["rear"]
    suspension["rocker_wheel"] = "front" if suspension["rocker_wheel"] == "rear" else "rear"
    return rover_from_dict(contents, name)
