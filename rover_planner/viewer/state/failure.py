# SPDX-License-Identifier: Apache-2.0
"""The first failure of a judged path: limit, value, wheel or link, place and time."""

from dataclasses import dataclass

import numpy as np

from rover_physics.limits.table import CHANCE
from rover_physics.names import SIDES, WHEEL_POSITIONS, WHEELS
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.verdict import Verdict
from rover_planner.planning.asked_poses import AskedPoses
from rover_planner.viewer.state.drive import RoverState, place_state
from rover_planner.viewer.state.path_limits import PathLimits, ShownLimit

BODY = "body"
"""Name of the body among the links."""
BODY_CODES = ("tilt", "tip_over", "belly")
"""Codes of limits of the body."""
TITLES = {
    "steering": "steering",
    "off_map": "off the map",
    "unknown_ground": "unknown ground",
    "not_settled": "does not settle",
    "no_equilibrium": "no equilibrium",
    "not_computable": "not computable",
    "trapped": "trapped",
    CHANCE: "chance of failure above what is accepted",
}
"""Short names of the codes of a verdict that have no number."""
ON_THE_WAY = "on the way here: "
"""Beginning of the reason of a failure between waypoints."""


@dataclass(frozen=True, eq=False)
class Failure:
    """The first failure of a path."""

    code: str
    """Code of the verdict."""
    reason: str
    """Reason of the verdict."""
    limit: ShownLimit
    """The broken limit."""
    value: float
    """The value that breaks it, in its unit; NaN if there is none."""
    use: float
    """Use of the limit there."""
    link: str
    """The link that fails: a name of WHEELS, BODY, rocker_left, bogie_right and so on; empty if
    it is none."""
    distance: float
    """Distance since the start [m]."""
    time: float
    """Time since the start [s]."""
    is_between: bool
    """True if it is between two waypoints."""
    row: int
    """Its row of the limits along the path."""
    state: RoverState
    """The rover there; a level one of unknown forces above the ground if it does not stand."""

    @property
    def where(self) -> str:
        """The link in words, such as "middle left wheel"; empty for none."""
        words = self.link.replace("_", " ")
        return f"{words} wheel" if self.link in WHEELS else words

    @property
    def place(self) -> str:
        """Where and when it is, in words."""
        between = ", between waypoints" if self.is_between else ""
        return f"after {self.distance:.2f} m, {self.time:.0f} s{between}"

    @property
    def headline(self) -> str:
        """The value beside the limit, such as "friction 1.32 of 1.00, middle left wheel"."""
        if not np.isnan(self.value):
            words = self.limit.compare(self.value)
        elif self.code in TITLES:
            words = TITLES[self.code]
        else:
            return self.reason.removeprefix(ON_THE_WAY)
        return f"{words}, {self.where}" if self.where else words


def find_failure(rover: Rover, terrain: Terrain, verdict: Verdict, limits: PathLimits) -> Failure:
    """Return the first failure of a path that is refused.

    Args:
        rover: The rover.
        terrain: The ground.
        verdict: The verdict on the path.
        limits: Its limits, as `find_path_limits` returns them.
    """
    lane, rows = limits.lane(verdict.code), limits.rows
    is_there = rows.prediction.waypoint == verdict.first_failure
    broken = np.flatnonzero(is_there & (lane.used > 1.0))
    if not broken.size:  # a recorded refusal that this rover does not explain
        broken = np.flatnonzero(is_there & ~rows.is_between)
    at = int(broken[np.argmin(rows.is_between[broken])])
    here, value = rows.prediction.select([at]), float(lane.values[at])
    limit = lane.limit.keep(float(here.results["kept_share"][0]))
    explains = limit.is_broken_by(value)
    return Failure(
        code=verdict.code,
        reason=verdict.reason,
        limit=limit,
        value=value if explains else np.nan,
        use=float(lane.used[at]),
        link=_find_link(rover, terrain, verdict.code, rows, at)
        or (WHEELS[lane.wheel[at]] if explains and lane.wheel[at] >= 0 else ""),
        distance=float(rows.distance[at]),
        time=float(rows.time[at]),
        is_between=bool(rows.is_between[at]),
        row=at,
        state=RoverState(rover, here, np.zeros(6))
        if here.settled[0]
        else level_state(rover, terrain, rows, at),
    )


def level_state(rover: Rover, terrain: Terrain, rows: AskedPoses, at: int) -> RoverState:
    """Return a level rover of unknown forces at a row, above the ground below its origin."""
    x, y, yaw = rows.prediction.poses[at].tolist()
    height = float(np.nan_to_num(terrain.elevation_at(x, y)))
    standing = rover.wheel.radius - rover.suspension.wheels["middle"][2]
    driven = {"distance": rows.distance[at], "time": rows.time[at]}
    position = np.array([x, y, height + standing])
    return place_state(rover, position, np.array([0.0, 0.0, yaw]), **driven)


def _find_link(rover: Rover, terrain: Terrain, code: str, rows: AskedPoses, at: int) -> str:
    """Return the link that fails at a row; empty if the wheel that decides the limit does."""
    part = rows.prediction
    if code in BODY_CODES:
        return BODY
    if code == "suspension":
        joints = np.hstack([part.rocker_angle[at], part.bogie_angle[at]])
        limits = rover.suspension.rocker_limits, rover.suspension.bogie_limits
        low, high = np.repeat(limits, 2, axis=0).T
        joint = int(np.argmin(np.minimum(joints - low, high - joints)))
        return f"{('rocker', 'bogie')[joint // 2]}_{SIDES[joint % 2]}"
    if code in ("off_map", "unknown_ground"):
        return _find_lost_wheel(rover, terrain, level_state(rover, terrain, rows, at))
    if code == "steering" and rover.steering is not None:
        turns = np.tile([name in rover.steering.wheels for name in WHEEL_POSITIONS], 2)
        allowed = np.where(turns, rover.steering.limit, 0.0)
        return WHEELS[int(np.argmax(np.abs(part.steering_angle[at]) - allowed))]
    return ""


def _find_lost_wheel(rover: Rover, terrain: Terrain, state: RoverState) -> str:
    """Return the wheel with the most of its footprint beyond known ground; empty for none."""
    offsets = rover.wheel.radius * np.linspace(-1.0, 1.0, 5)
    x = state.wheel_centres[:, 0, None, None] + offsets[:, None]
    y = state.wheel_centres[:, 1, None, None] + offsets
    lost = ~np.isfinite(terrain.elevation_at(x + 0.0 * y, y + 0.0 * x)).reshape(6, -1)
    counts = lost.sum(axis=1)
    return WHEELS[int(np.argmax(counts))] if counts.any() else ""
