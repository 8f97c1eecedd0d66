# SPDX-License-Identifier: Apache-2.0
"""Prediction of the rover along a path: one frozen record of arrays, a row per waypoint."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rover_physics.numerics.arrays import Floats
from rover_physics.results.path_bounds import PathBounds
from rover_physics.results.record import (
    QUANTITIES,
    VIEWS,
    find_column,
    new_results,
    numbers_of,
    select_results,
)
from rover_physics.status import PoseStatus

_SHAPES = {one.name: one.shape for one in QUANTITIES} | {
    name: shape for name, (_, _, shape) in VIEWS.items()
}


@dataclass(frozen=True, eq=False)
class PathPrediction:
    """Prediction at n waypoints: its attributes are the arrays (n, ...) of QUANTITIES and VIEWS.

    Such as `wheel_loads` (n, 6) [N] or `roll` (n,) [rad]. They are NaN where the rover did not
    settle, and read-only. Wheels and sides are in the order of `names`.
    """

    poses: Floats
    """(n, 3) x, y [m] and yaw [rad] of the body origin, map frame, as given."""
    results: Any
    """(n,) RESULT of each waypoint."""
    waypoint: NDArray[np.int64]
    """(n,) index of the waypoint of a row: its own, or the next one for a pose in between."""
    policy: str
    """Torque policy: "equal", "servo" or "optimal"."""
    control_margin: float = 0.0
    """Share of the limits of friction and torque that is left to the controller."""
    between: "PathPrediction | None" = None
    """Poses between waypoints where contacts jump, as on faces and edges; its own `between` is
    None."""
    bounds: PathBounds | None = None
    """Bounds on the prediction if the map is uncertain, added by `judge_path`; else None."""

    def __post_init__(self) -> None:
        for name in ("poses", "results", "waypoint"):
            array = getattr(self, name).view()
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    def __getattr__(self, name: str) -> Any:
        if name in VIEWS:
            first, count = find_column(name)
            columns = slice(first, first + count) if VIEWS[name][2] else first
            return numbers_of(self.results)[:, columns]
        if name in _SHAPES:
            return self.results[name]
        raise AttributeError(f"a PathPrediction has no {name!r}; it has {', '.join(_SHAPES)}")

    @property
    def status(self) -> NDArray[np.int8]:
        """(n,) PoseStatus of each waypoint."""
        return np.asarray(self.results["status"])

    @cached_property
    def settled(self) -> NDArray[np.bool_]:
        """(n,) True where all wheels touch the ground and the forces balance."""
        return _seal(self.status == PoseStatus.SETTLED)

    @cached_property
    def position(self) -> Floats:
        """(n, 3) body origin [m], map frame."""
        position = np.column_stack([self.poses[:, :2], self.results["q"][:, 0]])
        position[~self.settled] = np.nan
        return _seal(position)

    @cached_property
    def falling(self) -> NDArray[np.bool_]:
        """(n, 6) True for wheels that roll off an edge here; they need no equilibrium."""
        return _seal(self.results["falling"] > 0.0)

    @cached_property
    def wheel_speed(self) -> Floats:
        """(n, 6) nominal rates of the wheels [rad/s], without slip, negative where they roll back.

        NaN where the rover did not settle.
        """
        return _seal(np.where(self.settled[:, None], self.results["wheel_speed"], np.nan))

    @cached_property
    def steering_angle(self) -> Floats:
        """(n, 6) angles of the wheels about the z axes of their links [rad], left positive.

        Where the status is STEERING: the angles that the motion asks for.
        """
        asked = self.settled | (self.status == PoseStatus.STEERING)
        return _seal(np.where(asked[:, None], self.results["steering_angle"], np.nan))

    def cut(self, waypoints: int) -> "PathPrediction":
        """Return the prediction of the first waypoints and of the poses between them."""
        between, bounds = self.between, self.bounds
        if between is not None:
            between = between.select(between.waypoint < waypoints)
        bounds = None if bounds is None else bounds.cut(waypoints)
        return replace(self.select(slice(waypoints)), between=between, bounds=bounds)

    def select(self, rows: Any) -> "PathPrediction":
        """Return the rows of all arrays, without `between` and `bounds`."""
        return replace(
            self,
            poses=self.poses[rows],
            results=select_results(self.results, rows),
            waypoint=self.waypoint[rows],
            between=None,
            bounds=None,
        )

    def change(self, **values: ArrayLike) -> "PathPrediction":
        """Return the prediction with other values (n, ...) of some quantities or views."""
        results = self.results.copy()
        write_values(results, values)
        return replace(self, results=results)


def write_values(results: Any, values: dict[str, Any]) -> None:
    """Write values (n, ...) of quantities or views into RESULTs (n,), and the tilt they give."""
    numbers = numbers_of(results)
    for name, value in values.items():
        first, count = find_column(name)
        rows = np.asarray(value, float).reshape(len(results), count)
        numbers[:, first : first + count] = rows
    if "roll" in values or "pitch" in values:
        results["tilt"] = tilt_of(results["q"][:, 1], results["q"][:, 2])


def prediction_of(
    poses: Floats, status: NDArray[np.int8], values: dict[str, Any], policy: str
) -> PathPrediction:
    """Return the prediction of n waypoints from its arrays, as a file or a log has them.

    Args:
        poses: (n, 3) x, y [m] and yaw [rad], map frame.
        status: (n,) PoseStatus.
        values: Arrays (n, ...) of quantities and views, and `position` (n, 3).
        policy: Torque policy, or what made the values.
    """
    results = new_results(len(poses))
    for name in ("kept_share", "friction_share", "torque_share"):
        results[name] = 1.0 if name == "kept_share" else 0.0
    height, known = np.asarray(values["position"])[:, 2], dict(values)
    known.pop("position")
    write_values(results, known)
    results["status"] = status
    results["q"][:, 0], results["q"][:, 3] = height, results["rocker_angle"][:, 0]
    return PathPrediction(poses, results, np.arange(len(poses)), policy)


def tilt_of(roll: ArrayLike, pitch: ArrayLike) -> Floats:
    """Return the angle [rad] between the body's z axis and the vertical."""
    return np.arccos(np.clip(np.cos(roll) * np.cos(pitch), -1.0, 1.0))


def _seal(array: Any) -> Any:
    array.flags.writeable = False
    return array
