# SPDX-License-Identifier: Apache-2.0
"""The first failure of a path: which limit, by how much, which wheel or link, where and when."""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from rover_physics.names import SIDES, WHEEL_POSITIONS, WHEELS
from rover_physics.numerics.arrays import Floats
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.verdict import Verdict
from rover_planner.viewer.state.reasons.limits import WAYS, Limit
from rover_planner.viewer.state.reasons.path_limits import PathLimits, Use
from rover_planner.viewer.state.trajectory import MAX_VALUE, PLACES, RoverState

BODY = "body"
"""Name of the body among the links."""
BODY_CODES = ("tilt", "tip_over", "belly")
"""Codes of limits of the body."""
ON_THE_WAY = "on the way here: "
"""How the reason of a failure between waypoints begins."""
MAX_BETWEEN = 8
"""Most poses before a failure that are shown beside it."""


@dataclass(frozen=True, eq=False)
class Failure:
    """The first failure of a path."""

    code: str
    """Code of the verdict."""
    reason: str
    """Reason of the verdict."""
    limit: Limit
    """The broken limit."""
    value: float
    """The value that breaks it, in its unit; NaN if there is none."""
    link: str
    """The link that fails: a name of WHEELS, BODY, rocker_left, bogie_right and so on; empty if
    it is none."""
    distance: float
    """Distance since the start [m]."""
    time: float
    """Time since the start [s]."""
    is_between: bool
    """Whether it is between two waypoints."""
    is_settled: bool
    """Whether the rover stands there; if not, `state` is a level rover above the ground."""
    state: RoverState
    """The rover there."""
    between: tuple[RoverState, ...] = ()
    """The rover at poses between the waypoints before it, where the model was asked."""

    @property
    def where(self) -> str:
        """The link in words, such as "middle left wheel"; empty for none."""
        words = self.link.replace("_", " ")
        return f"{words} wheel" if self.link in WHEELS else words

    @property
    def headline(self) -> str:
        """The value beside the limit, such as "friction 1.32 of 1.00, middle left wheel"."""
        if not np.isnan(self.value):
            words = self.limit.compare(self.value)
        elif self.code in WAYS:
            words = WAYS[self.code]
        else:
            return self.reason.removeprefix(ON_THE_WAY)
        return f"{words}, {self.where}" if self.where else words


def find_failure(
    rover: Rover,
    terrain: Terrain,
    prediction: PathPrediction,
    verdict: Verdict,
    limits: PathLimits,
) -> Failure | None:
    """Return the first failure of a judged path; None if there is none.

    Args:
        rover: The rover.
        terrain: The ground.
        prediction: The prediction of the path.
        verdict: The verdict on it.
        limits: Its limits, as `find_path_limits` returns them.
    """
    if verdict.first_failure < 0:
        return None
    lane, rows = limits.lane(verdict.code), limits.rows
    here = rows.waypoint == verdict.first_failure
    broken = np.flatnonzero(here & (lane.use == Use.BROKEN))
    if not broken.size:  # a recorded refusal that this rover does not explain
        broken = np.flatnonzero(here & ~rows.is_between)
    at = int(broken[np.argmin(rows.is_between[broken])])
    is_between, row = bool(rows.is_between[at]), int(rows.row[at])
    part = prediction.between if is_between and prediction.between is not None else prediction
    settled = bool(part.settled[row])
    distance, time = float(rows.distance[at]), float(rows.time[at])
    pose = part.poses[row]
    state = (
        state_of(part, row, distance, time)
        if settled
        else level_state(rover, terrain, pose, distance, time)
    )
    value = float(lane.values[at])
    wheel = int(lane.wheel[at]) if lane.limit.is_broken_by(value) else -1
    link = _find_link(rover, terrain, (verdict.code, part, row), wheel)
    return Failure(
        code=verdict.code,
        reason=verdict.reason,
        limit=lane.limit,
        value=value if lane.limit.is_broken_by(value) else np.nan,
        link=link,
        distance=distance,
        time=time,
        is_between=is_between,
        is_settled=settled,
        state=state,
        between=_states_between(prediction, limits, at),
    )


def _states_between(prediction: PathPrediction, limits: PathLimits, at: int) -> tuple[Any, ...]:
    """Return the states at poses between the waypoints before a row, of its last two waypoints."""
    rows, between = limits.rows, prediction.between
    if between is None:
        return ()
    near = rows.is_between & (rows.waypoint >= rows.waypoint[at] - 1)
    near[at] = False
    found = [k for k in np.flatnonzero(near[: at + 1]) if between.settled[rows.row[k]]]
    return tuple(
        state_of(between, int(rows.row[k]), float(rows.distance[k]), float(rows.time[k]))
        for k in found[-MAX_BETWEEN:]
    )


def state_of(part: PathPrediction, row: int, distance: float, time: float) -> RoverState:
    """Return the state at a row of a prediction, at a distance [m] and a time [s]."""
    values: dict[str, Any] = {
        field.name: getattr(part, field.name)[row]
        for field in fields(RoverState)
        if hasattr(part, field.name)
    }
    x, y = part.motion[row, :2]
    values |= {
        "distance": distance,
        "time": time,
        "attitude": np.array([part.roll[row], part.pitch[row], part.poses[row, 2]]),
        "spin": np.zeros(6),
        "speed": np.hypot(x, y),
    }
    finite: dict[str, Any] = {}
    for name, value in values.items():
        known = value if name in PLACES else np.clip(np.nan_to_num(value), -MAX_VALUE, MAX_VALUE)
        finite[name] = float(known) if np.ndim(known) == 0 else known
    return RoverState(**finite)


def level_state(
    rover: Rover, terrain: Terrain, pose: Floats, distance: float, time: float
) -> RoverState:
    """Return a level rover without forces over a pose x, y [m], yaw [rad]."""
    x, y, yaw = pose.tolist()
    height = float(terrain.elevation_at(x, y))
    height = height if np.isfinite(height) else 0.0
    standing = rover.wheel.radius - rover.suspension.wheels["middle"][2]
    position = np.array([x, y, height + standing])
    c, s = np.cos(yaw), np.sin(yaw)
    centres = place_wheels(rover) @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    sizes = {"rocker_angle": 2, "bogie_angle": 2, "motion": 3}
    values: dict[str, Any] = {
        field.name: 0.0 if field.type is float else np.zeros(sizes.get(field.name, 6))
        for field in fields(RoverState)
    }
    values |= {
        "distance": distance,
        "time": time,
        "position": position,
        "attitude": np.array([0.0, 0.0, yaw]),
        "wheel_centres": position + centres,
        "contact_points": position + centres - [0.0, 0.0, rover.wheel.radius],
    }
    return RoverState(**values)


def place_wheels(rover: Rover) -> Floats:
    """Return the wheel centres (6, 3) on flat ground, body frame [m]."""
    wheels = rover.suspension.wheels
    sides = {"left": 1.0, "right": -1.0}
    return np.array(
        [
            np.multiply(wheels[name], (1.0, sides[side], 1.0))
            for side in SIDES
            for name in WHEEL_POSITIONS
        ]
    )


def _find_link(
    rover: Rover, terrain: Terrain, at: tuple[str, PathPrediction, int], wheel: int
) -> str:
    """Return the link that fails at a code, a part of the prediction and a row of it."""
    code, part, row = at
    if code in BODY_CODES:
        return BODY
    if code == "suspension":
        joints = np.hstack([part.rocker_angle[row], part.bogie_angle[row]])
        limits = rover.suspension.rocker_limits, rover.suspension.bogie_limits
        low, high = np.repeat(limits, 2, axis=0).T
        joint = int(np.argmin(np.minimum(joints - low, high - joints)))
        return f"{('rocker', 'bogie')[joint // 2]}_{SIDES[joint % 2]}"
    if code in ("off_map", "unknown_ground"):
        state = level_state(rover, terrain, part.poses[row], 0.0, 0.0)
        wheel = _find_lost_wheel(rover, terrain, state.wheel_centres)
    if code == "steering" and rover.steering is not None:
        turns = np.tile([name in rover.steering.wheels for name in WHEEL_POSITIONS], 2)
        allowed = np.where(turns, rover.steering.limit, 0.0)
        wheel = int(np.argmax(np.abs(part.steering_angle[row]) - allowed))
    return WHEELS[wheel] if wheel >= 0 else ""


def _find_lost_wheel(rover: Rover, terrain: Terrain, centres: Floats) -> int:
    """Return the wheel with the most of its footprint beyond known ground; -1 for none."""
    radius = rover.wheel.radius
    offsets = radius * np.linspace(-1.0, 1.0, 5)
    x = centres[:, 0, None, None] + offsets[:, None]
    y = centres[:, 1, None, None] + offsets
    lost = ~np.isfinite(terrain.elevation_at(x + 0.0 * y, y + 0.0 * x)).reshape(6, -1)
    counts = lost.sum(axis=1)
    return int(np.argmax(counts)) if counts.any() else -1
