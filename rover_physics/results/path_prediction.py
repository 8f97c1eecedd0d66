# SPDX-License-Identifier: Apache-2.0
"""Prediction of the rover along a path, and its bounds: frozen records, a row per waypoint."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rover_physics.numerics.arrays import Floats, freeze_fields, seal_array, view_read_only
from rover_physics.numerics.records import record_type
from rover_physics.results.record import (
    QUANTITIES,
    VIEWS,
    find_column,
    new_results,
    numbers_of,
    select_results,
)
from rover_physics.status import BoundStatus, PoseStatus

_NAMES = (*(one.name for one in QUANTITIES), *VIEWS)

WAYPOINT_BOUNDS = record_type(
    ("status", np.int8),  # a BoundStatus
    ("roll", float, (2,)),  # [rad]
    ("pitch", float, (2,)),  # [rad]
    ("rocker_angle", float, (2, 2)),  # right and left [rad]
    ("bogie_angle", float, (2, 2)),  # right and left [rad]
    ("belly_clearance", float, (2,)),  # [m]
    ("tip_over_ratio", float, (2,)),
    ("wheel_loads", float, (6, 2)),  # [N]; the largest is infinite under policy "optimal"
    ("friction_utilisation", float, (6, 2)),
    ("torque_saturation", float, (6, 2)),
    ("sinkage", float, (6, 2)),  # [m]
)
"""Smallest and largest value at one pose, of quantities as in `PathPrediction`.

The torques of policy "optimal" follow the ground, so that a load has no upper bound.
"""
BOUNDED_VALUES = tuple(name for name in WAYPOINT_BOUNDS.names or () if name != "status")
"""Names of the bounded values."""


@dataclass(frozen=True, eq=False)
class PathBounds:
    """Bounds at n waypoints: the arrays (n, ..., 2) of WAYPOINT_BOUNDS as attributes, and more.

    The last axis holds smallest and largest value. A waypoint without bounds has NaN. All arrays
    are read-only.
    """

    sigmas: float
    """Number of standard deviations by which the map's heights may be wrong."""
    values: Any
    """(n,) WAYPOINT_BOUNDS of each waypoint."""

    def __post_init__(self) -> None:
        freeze_fields(self)

    def __getattr__(self, name: str) -> Any:
        if name in (WAYPOINT_BOUNDS.names or ()):
            return self.values[name]
        raise AttributeError(f"a PathBounds has no {name!r}; it has {', '.join(BOUNDED_VALUES)}")

    @property
    def bounded(self) -> NDArray[np.bool_]:
        """(n,) True for the waypoints that have bounds."""
        return np.asarray(self.status == BoundStatus.BOUNDED)

    @property
    def tilt(self) -> Floats:
        """(n, 2) smallest and largest angle between the body's z axis and the vertical [rad]."""
        return tilt_of(_sizes(self.roll), _sizes(self.pitch))


@dataclass(frozen=True, eq=False)
class PathPrediction:
    """Prediction at n waypoints: its attributes are the arrays (n, ...) of QUANTITIES and VIEWS.

    Such as `wheel_loads` (n, 6) [N] or `roll` (n,) [rad]. Where the rover did not settle they are
    NaN, but for what motion and path alone tell, such as `distance`. They are read-only. Wheels
    and sides are in the order of `names`.
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
            object.__setattr__(self, name, view_read_only(getattr(self, name)))

    def __getattr__(self, name: str) -> Any:
        if name in VIEWS:
            first, count = find_column(name)
            columns = slice(first, first + count) if VIEWS[name][2] else first
            return numbers_of(self.results)[:, columns]
        if name in _NAMES:
            return self.results[name]
        raise AttributeError(f"a PathPrediction has no {name!r}; it has {', '.join(_NAMES)}")

    @property
    def status(self) -> NDArray[np.int8]:
        """(n,) PoseStatus of each waypoint."""
        return np.asarray(self.results["status"])

    @cached_property
    def settled(self) -> NDArray[np.bool_]:
        """(n,) True where all wheels touch the ground and the forces balance."""
        return seal_array(self.status == PoseStatus.SETTLED)

    @cached_property
    def position(self) -> Floats:
        """(n, 3) body origin [m], map frame."""
        position = np.column_stack([self.poses[:, :2], self.results["q"][:, 0]])
        position[~self.settled] = np.nan
        return seal_array(position)

    @cached_property
    def falling(self) -> NDArray[np.bool_]:
        """(n, 6) True for wheels that roll off an edge here; they need no equilibrium."""
        return seal_array(self.results["falling"] > 0.0)

    @cached_property
    def wheel_speed(self) -> Floats:
        """(n, 6) nominal rates of the wheels [rad/s], without slip, negative where they roll back.

        NaN where the rover did not settle.
        """
        return seal_array(np.where(self.settled[:, None], self.results["wheel_speed"], np.nan))

    @cached_property
    def steering_angle(self) -> Floats:
        """(n, 6) angles of the wheels about the z axes of their links [rad], left positive.

        Where the status is STEERING: the angles that the motion asks for.
        """
        asked = self.settled | (self.status == PoseStatus.STEERING)
        return seal_array(np.where(asked[:, None], self.results["steering_angle"], np.nan))

    def cut(self, waypoints: int) -> "PathPrediction":
        """Return the prediction of the first waypoints and of the poses between them."""
        between, bounds = self.between, self.bounds
        if between is not None:
            between = between.select(between.waypoint < waypoints)
        if bounds is not None:
            bounds = replace(bounds, values=bounds.values[:waypoints])
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
    results["kept_share"], results["friction_share"], results["torque_share"] = 1.0, 0.0, 0.0
    known = dict(values)
    height = np.asarray(known.pop("position"))[:, 2]
    write_values(results, known)
    results["status"] = status
    results["q"][:, 0], results["q"][:, 3] = height, results["rocker_angle"][:, 0]
    return PathPrediction(poses, results, np.arange(len(poses)), policy)


def tilt_of(roll: ArrayLike, pitch: ArrayLike) -> Floats:
    """Return the angle [rad] between the body's z axis and the vertical."""
    return np.arccos(np.clip(np.cos(roll) * np.cos(pitch), -1.0, 1.0))


def _sizes(angles: Floats) -> Floats:
    """Return the smallest and largest absolute value (n, 2) within intervals (n, 2)."""
    sizes = np.sort(np.abs(angles), axis=1)
    sizes[angles[:, 0] * angles[:, 1] < 0.0, 0] = 0.0
    return sizes
