"""Between waypoints: faces that wheels climb, edges they roll off, and how far they drop.

Where the contact of a wheel jumps from one waypoint to the next, the poses in between decide
whether the rover gets there. The path is halved around each jump until the jump is resolved or
shorter than SHORTEST. What is left is a jump in height at one place: upwards the wheel is
evaluated while it climbs the face, held at heights from foot to edge with the face as its
contact; downwards it drops.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
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
PIECES = 4
"""Pieces into which a stretch with a jump is divided, again and again."""
SHORTEST = 1e-4
"""Distance between poses [m] below which a jump counts as one place."""
CLIMB_STAGES = np.linspace(0.0, 1.0, 6)
"""Shares of the height of a face at which a climbing wheel is evaluated; at its foot only where
the wheel has the edge of the face there, for no later contact is as steep."""

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

    def select(self, rows: np.ndarray | slice) -> "Crossings":
        """Return the poses that a mask (m,) has, or those of some rows in their order."""
        return Crossings(
            self.place[rows], self.waypoint[rows], self.poses[rows], self.results[rows]
        )

    def between(self, first: int, end: int) -> "Crossings":
        """Return what lies between waypoints `first` and `end`, counted from the first of them."""
        start, stop = np.searchsorted(self.place, (first, end))
        part = self.select(slice(start, stop))
        return replace(part, place=part.place - first, waypoint=part.waypoint - first)


def find_crossings(
    terrain: Terrain,
    radius: float,
    poses: np.ndarray,
    results: Any,
    evaluate: Evaluate,
    direction: float = 1.0,
    joined: np.ndarray | bool = True,
) -> Crossings:
    """Evaluate the poses between waypoints where contacts jump.

    Args:
        terrain: The ground.
        radius: Wheel radius [m].
        poses: (n, 3) waypoints of one path, or of several behind one another.
        results: (n,) their RESULTs.
        evaluate: Evaluates poses (k, 3), with heights and contact angles (k, 6, 2) of held
            wheels or NONE_HELD.
        direction: 1 where the rover drives forwards along the path, -1 backwards.
        joined: (n - 1,) True where the path leads from a waypoint to the next one.
    """
    spacing = np.hypot(*np.diff(poses[:, :2], axis=0).T)
    near = (spacing <= radius) & (spacing > 0.0) & joined
    at = np.flatnonzero(_jumps(results, slice(None, -1), slice(1, None), radius) & near)
    open_ = _Stretches(
        np.column_stack([at, at + 1.0]),
        poses[np.column_stack([at, at + 1])],
        results[np.column_stack([at, at + 1])],
    )
    found = []
    while len(open_.place):
        inner = open_.divide(evaluate)
        found.append(inner.select(inner.results["status"] != NOT_SETTLED))
        pieces, stuck = open_.split(inner, radius)
        short = np.hypot(*(pieces.poses[:, 1] - pieces.poses[:, 0])[:, :2].T) < SHORTEST
        found.append(_climb(terrain, radius, pieces.select(short | stuck), evaluate, direction))
        open_ = pieces.select(~(short | stuck))
    return _in_order(found)


_NOTHING = Crossings(np.empty(0), np.empty(0, int), np.empty((0, 3)), new_results(0))


@dataclass(frozen=True, eq=False)
class _Stretches:
    """Stretches of the path within which a contact jumps."""

    place: np.ndarray
    """(k, 2) places where each begins and ends, counted in waypoints."""
    poses: np.ndarray
    """(k, 2, 3) the poses there."""
    results: np.ndarray
    """(k, 2) the RESULTs there."""

    @property
    def waypoint(self) -> np.ndarray:
        """(k,) index of the waypoint that follows."""
        return np.floor(self.place[:, 0]).astype(int) + 1

    def select(self, mask: np.ndarray) -> "_Stretches":
        """Return the stretches where `mask` (k,) is True."""
        return _Stretches(self.place[mask], self.poses[mask], self.results[mask])

    def divide(self, evaluate: Evaluate) -> Crossings:
        """Return the results at PIECES - 1 poses within each stretch, stretch by stretch."""
        share = np.arange(1, PIECES) / PIECES
        first, last = self.poses[:, 0], self.poses[:, 1]
        way = last - first
        way[:, 2] = (way[:, 2] + np.pi) % (2.0 * np.pi) - np.pi
        poses = (first[:, None] + share[:, None] * way[:, None]).reshape(-1, 3)
        start, end = self.place[:, :1], self.place[:, 1:]
        return Crossings(
            (start + share * (end - start)).ravel(),
            np.repeat(self.waypoint, PIECES - 1),
            poses,
            evaluate(poses, NONE_HELD),
        )

    def split(self, inner: Crossings, radius: float) -> tuple["_Stretches", np.ndarray]:
        """Return the pieces within which a contact still jumps, and which of them are stuck.

        Stuck (k,) are those that hold a pose in which the rover does not settle.
        """
        k = len(self.place)

        def insert(ends: np.ndarray, between: np.ndarray) -> np.ndarray:
            whole = np.empty((k, PIECES + 1, *ends.shape[2:]), ends.dtype)
            whole[:, 0], whole[:, -1] = ends[:, 0], ends[:, 1]
            whole[:, 1:-1] = between.reshape(k, PIECES - 1, *between.shape[1:])
            return whole.reshape(k * (PIECES + 1), *whole.shape[2:])

        results = insert(self.results, inner.results)
        known = np.flatnonzero(results["status"] != NOT_SETTLED)
        before, after = known[:-1], known[1:]
        same = before // (PIECES + 1) == after // (PIECES + 1)
        before, after = before[same], after[same]
        jumps = _jumps(results, before, after, radius)
        ends = np.column_stack([before[jumps], after[jumps]])
        place, poses = insert(self.place, inner.place), insert(self.poses, inner.poses)
        return _Stretches(place[ends], poses[ends], results[ends]), ends[:, 1] - ends[:, 0] > 1


def _in_order(found: list[Crossings]) -> Crossings:
    found = [part for part in found if len(part.place)]
    if not found:
        return _NOTHING
    place = np.concatenate([part.place for part in found])
    results, end = new_results(len(place)), 0
    for part in found:
        end += len(part.place)
        results[end - len(part.place) : end] = part.results
    together = Crossings(
        place,
        np.concatenate([part.waypoint for part in found]),
        np.concatenate([part.poses for part in found]),
        results,
    )
    return together.select(np.argsort(place, kind="stable"))


def _jumps(
    results: np.ndarray, before: np.ndarray | slice, after: np.ndarray | slice, radius: float
) -> np.ndarray:
    """Return (k,) True where a contact jumps between the rows before (k,) and after (k,)."""
    settled = results["status"] == SETTLED
    angle, height = results["contact_angle"], results["wheel_centres"][:, :, 2]
    here, there = angle[before], angle[after]
    steep = np.maximum(np.abs(here), np.abs(there)) > STEEP
    turned = steep & (np.abs(there - here) > ANGLE_JUMP)
    rise = np.abs(height[after] - height[before]) > HEIGHT_JUMP * radius
    jumps = settled[before] & settled[after] & np.any(turned | rise, axis=1)
    return np.asarray(jumps)


def _climb(
    terrain: Terrain, radius: float, places: _Stretches, evaluate: Evaluate, direction: float
) -> Crossings:
    """Evaluate wheels held at stages between foot and edge where they jump up at one place."""
    before, after = places.results[:, 0]["wheel_centres"], places.results[:, 1]["wheel_centres"]
    rise = (after - before)[:, :, 2]
    climbing = rise > 0.05 * radius
    at = np.flatnonzero(np.any(climbing & (rise > HEIGHT_JUMP * radius), axis=1))
    if not len(at):
        return _NOTHING
    stages = len(CLIMB_STAGES)
    held = np.full((len(at), stages, 6, 2), np.nan)
    for row, i in enumerate(at):
        course = places.poses[i, 0, 2] + (0.0 if direction > 0.0 else np.pi)
        for wheel in np.flatnonzero(climbing[i]):
            centre = before[i, wheel]
            face, edge = _face_ahead(terrain, radius, centre, course)
            for k, height in enumerate(centre[2] + CLIMB_STAGES * rise[i, wheel]):
                if k > 0 or height > edge:
                    angle = direction * _angle_on_face(radius, height, face, edge)
                    held[row, k, wheel] = height, angle
    poses = np.repeat(places.poses[at, 0], stages, axis=0)
    results = evaluate(poses, held.reshape(-1, 6, 2))
    start, end = places.place[at, :1], places.place[at, 1:]
    settled = (results["status"] == SETTLED).reshape(-1, stages)
    climbs = Crossings(
        (start + CLIMB_STAGES * (end - start)).ravel(),
        np.repeat(places.waypoint[at], stages),
        poses,
        results,
    )
    return climbs.select((settled | ~settled.any(axis=1, keepdims=True)).ravel())


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
