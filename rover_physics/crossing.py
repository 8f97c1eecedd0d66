"""Between waypoints: faces that wheels climb, edges they roll off, and how far they drop.

Where the contact of a wheel jumps from one waypoint to the next, the poses in between decide
whether the rover gets there. The path is halved around each jump until the jump is resolved or
shorter than SHORTEST. What is left is a jump in height at one place: upwards the wheel is
evaluated while it climbs the face, held at heights from foot to edge with the face as its
contact; downwards it drops.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from rover_physics.evaluation import NONE_HELD, new_results
from rover_physics.settling import NOT_SETTLED, SETTLED
from rover_physics.terrain import Terrain

ANGLE_JUMP = np.radians(12.0)
"""Change of a contact angle that is looked into, where one of the two is steep."""
STEEP = np.radians(25.0)
HEIGHT_JUMP = 0.25
"""Change of a wheel's height, in wheel radii, that is looked into."""
SHORTEST = 1e-4
"""Distance between poses [m] below which a jump counts as one place."""
CLIMB_STAGES = np.linspace(0.0, 1.0, 6)[1:]
"""Shares of the height of a face at which a climbing wheel is evaluated."""

Evaluate = Callable[[np.ndarray, np.ndarray], Any]


@dataclass(frozen=True, eq=False)
class Crossings:
    """Poses between waypoints, in the order of the path."""

    place: np.ndarray
    """(m,) place along the path, counted in waypoints."""
    waypoint: np.ndarray
    """(m,) index of the waypoint that follows."""
    poses: np.ndarray
    """(m, 3) x, y [m], yaw [rad]."""
    results: Any
    """(m,) RESULT of each pose."""


def find_crossings(
    terrain: Terrain,
    radius: float,
    poses: np.ndarray,
    results: Any,
    evaluate: Evaluate,
    direction: float = 1.0,
) -> Crossings:
    """Evaluate the poses between waypoints where contacts jump.

    Args:
        terrain: The ground.
        radius: Wheel radius [m].
        poses: (n, 3) waypoints.
        results: (n,) their RESULTs.
        evaluate: Evaluates poses (k, 3), with heights and contact angles (k, 6, 2) of held
            wheels or NONE_HELD.
        direction: 1 where the rover drives forwards along the path, -1 backwards.
    """
    found: list[tuple[float, np.ndarray, Any, int]] = []
    spacing = np.hypot(*np.diff(poses[:, :2], axis=0).T)
    on_a_path = (spacing <= radius) & (spacing > 0.0)
    jumps = _find_jumps(results, radius)
    open_ = [
        (float(i), i + 1.0, poses[i], poses[i + 1], results[i], results[i + 1])
        for i in np.flatnonzero(on_a_path & jumps)
    ]
    while open_:
        middles = np.array([_between(a, b) for _, _, a, b, _, _ in open_])
        inner = evaluate(middles, NONE_HELD)
        halves: list[tuple] = []
        places: list[tuple] = []
        for k, (start, end, a, b, row_a, row_b) in enumerate(open_):
            centre, row = 0.5 * (start + end), inner[k]
            if row.status == NOT_SETTLED:
                places.append(open_[k])
                continue
            found.append((centre, middles[k], row, int(np.floor(start)) + 1))
            pieces = (
                (start, centre, a, middles[k], row_a, row),
                (centre, end, middles[k], b, row, row_b),
            )
            for piece in pieces:
                if _jumps(piece[4], piece[5], radius):
                    short = np.hypot(*(piece[3] - piece[2])[:2]) < SHORTEST
                    (places if short else halves).append(piece)
        found.extend(_climb(terrain, radius, places, evaluate, direction))
        open_ = halves
    return _in_order(found)


def _in_order(found) -> Crossings:
    found = sorted(found, key=lambda item: item[0])
    waypoint = np.array([item[3] for item in found], dtype=int)
    poses = np.array([item[1] for item in found]).reshape(-1, 3)
    place = np.array([item[0] for item in found])
    results = new_results(len(found))
    for k, item in enumerate(found):
        results[k] = item[2]
    return Crossings(place, waypoint, poses, results)


def _between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    turn = (b[2] - a[2] + np.pi) % (2.0 * np.pi) - np.pi
    return np.array([0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]), a[2] + 0.5 * turn])


def _find_jumps(results: Any, radius: float) -> np.ndarray:
    """Return (k - 1,) True between k results where a contact jumps."""
    settled, angle = results["status"] == SETTLED, results["contact_angle"]
    steep = np.maximum(np.abs(angle[1:]), np.abs(angle[:-1])) > STEEP
    turned = steep & (np.abs(np.diff(angle, axis=0)) > ANGLE_JUMP)
    lifted = np.abs(np.diff(results["wheel_centres"][:, :, 2], axis=0)) > HEIGHT_JUMP * radius
    return settled[1:] & settled[:-1] & np.any(turned | lifted, axis=1)


def _jumps(before: Any, after: Any, radius: float) -> bool:
    return bool(_find_jumps(np.array([before, after]), radius)[0])


def _climb(
    terrain: Terrain, radius: float, places, evaluate: Evaluate, direction: float
) -> list[tuple]:
    """Evaluate wheels held at stages between foot and edge where they jump up at one place."""
    poses, held, keys = [], [], []
    for start, end, a, _, row_a, row_b in places:
        rise = row_b.wheel_centres[:, 2] - row_a.wheel_centres[:, 2]
        climbing = rise > 0.05 * radius
        if not climbing.any() or rise.max() <= HEIGHT_JUMP * radius:
            continue
        course = a[2] if direction > 0.0 else a[2] + np.pi
        face = [_face_ahead(terrain, radius, row_a.wheel_centres[w], course) for w in range(6)]
        for stage in CLIMB_STAGES:
            holds = np.full((6, 2), np.nan)
            for wheel in np.flatnonzero(climbing):
                height = row_a.wheel_centres[wheel, 2] + stage * rise[wheel]
                holds[wheel] = height, direction * _angle_on_face(radius, height, *face[wheel])
            poses.append(a)
            held.append(holds)
            keys.append((start + stage * (end - start), int(np.floor(start)) + 1))
    if not poses:
        return []
    rows = evaluate(np.array(poses), np.array(held))
    stages = len(CLIMB_STAGES)
    climbs = []
    for first in range(0, len(rows), stages):
        group = range(first, first + stages)
        settled = [k for k in group if rows[k].status == SETTLED]
        for k in settled or group:
            place, waypoint = keys[k]
            climbs.append((place, poses[k], rows[k], waypoint))
    return climbs


def _face_ahead(terrain: Terrain, radius: float, centre: np.ndarray, yaw: float):
    """Return slope angle [rad] and edge height [m] of the ground just ahead of a wheel."""
    step = 0.25 * terrain.resolution
    ahead = np.arange(0.0, radius + 2.0 * terrain.resolution, step)
    heights = terrain.elevation_at(
        centre[0] + ahead * np.cos(yaw), centre[1] + ahead * np.sin(yaw)
    )
    slopes = np.diff(heights) / step
    if not np.isfinite(slopes).any():
        return 0.5 * np.pi, np.inf
    return float(np.arctan(np.nanmax(slopes))), float(np.nanmax(heights))


def _angle_on_face(radius: float, height: float, face: float, edge: float) -> float:
    """Return the contact angle of a wheel with its centre at `height`: on the face or its edge."""
    above = (height - edge) / radius
    return face if above <= 0.0 else min(face, float(np.arccos(min(above, 1.0))))
