# SPDX-License-Identifier: Apache-2.0
"""The limits as people read them, their use along a path, and where the path first fails."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from rover_physics.chance.failure_chance import FailureChance
from rover_physics.limits.table import CHANCE, LIMITS, RATIO, Sense, Unit
from rover_physics.names import WHEELS
from rover_physics.numerics.arrays import Floats
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.results.record import find_column, numbers_of
from rover_physics.results.uses import ABOVE, Uses, find_uses, limits_of
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.classification import find_wheel
from rover_physics.traversability.verdict import Verdict
from rover_planner.planning.asked_poses import AskedPoses, merge_poses
from rover_planner.viewer.state.drive import RoverState, place_state

GROUND = "ground"
"""Code of what is no limit of a number: unknown ground, no equilibrium, entrapment, steering."""
MORE_DIGITS = 2
"""Most digits beyond those of the unit that tell a value from its limit; else words do."""
HUGE = 1e5
"""Value from which a number is told in words."""
BODY = "body"
"""Name of the body among the links."""
BODY_CODES = {row.code for row in LIMITS} - {
    row.code for row in LIMITS if row.wheel_of or row.elements or find_column(row.reads)[1] > 1
}
"""Codes of limits of the body: their values are neither of wheels nor of joints."""
TITLES = {
    "off_map": "off the map",
    "not_settled": "does not settle",
    CHANCE: "chance of failure above what is accepted",
}
"""Short names of codes without a number; others are their own."""
ON_THE_WAY = "on the way here: "
"""Beginning of the reason of a failure between waypoints."""


@dataclass(frozen=True, eq=False)
class Lane:
    """One limit along the path, in the unit that people read; arrays (m,) as in `AskedPoses`."""

    code: str
    """Code of a verdict, or GROUND."""
    title: str
    """Short name."""
    used: Floats
    """Use of the limit: 1 at the limit, above 1 where it is broken, NaN where it does
    not count or is not known."""
    values: Floats = field(default_factory=lambda: np.empty(0))
    """The value nearest to the limit, NaN where it has none; empty as `bounds`."""
    bounds: Floats | None = None
    """(m,) largest or smallest good value; None if it is not a single number."""
    unit: Unit = RATIO
    """Unit of values and bounds."""
    is_lowest: bool = False
    """True if the bounds are smallest good values, not largest."""
    decides: NDArray[np.int64] | None = None
    """(m,) which of the rover's limits it is that is used most; None for what is no limit."""
    wheels: Floats | None = None
    """(m, 6) use by each wheel; None if the limit is not one value for each wheel."""

    def compare(self, row: int) -> str:
        """Return value and limit at a row, such as "friction 1.32 of 1.00", with enough digits.

        Where MORE_DIGITS do not tell them apart, words do: "friction just above 1.00". So they do
        where there is no number, as without load: "friction far above 1.00".
        """
        if self.bounds is None:
            return self.title
        unit, value, bound = f" {self.unit.name}".rstrip(), self.values[row], self.bounds[row]
        if abs(value) >= HUGE:  # a wheel that lifts off
            return f"{self.title} far above {write(bound, self.unit.digits)}{unit}"
        for digits in range(self.unit.digits, self.unit.digits + MORE_DIGITS + 1):
            shown, limit = write(value, digits), write(bound, digits)
            if shown != limit:
                least = "at least " if self.is_lowest else ""
                return f"{self.title} {shown} of {least}{limit}{unit}"
        side = "at" if value == bound else "just above" if value > bound else "just below"
        return f"{self.title} {side} {write(bound, self.unit.digits)}{unit}"

    def write_value(self, row: int) -> str:
        """Return value and limit at a row, such as "0.76, max 1.00"; empty if there is none."""
        if self.bounds is None or np.isnan(self.values[row]):
            return ""
        word, digits = "min" if self.is_lowest else "max", self.unit.digits
        good = write(self.bounds[row], digits, self.unit.name)
        return f"{write(self.values[row], digits)}, {word} {good}"


@dataclass(frozen=True, eq=False)
class PathLimits:
    """All limits along a path up to its first failure."""

    rows: AskedPoses
    """The poses."""
    lanes: tuple[Lane, ...]
    """The limits, in the order in which they become reasons."""
    uses: Uses
    """The uses of all limits of the rover at the poses."""

    def lane(self, code: str) -> Lane:
        """Return the lane of a code of a verdict; that of the ground for other codes."""
        found = {lane.code: lane for lane in self.lanes}
        return found.get(code, found[GROUND])

    def find_link(self, lane: Lane, row: int) -> str:
        """Return the wheel or joint that decides a lane at a row, such as rocker_left, or ""."""
        if lane.decides is None:
            return ""
        k = int(lane.decides[row])
        limit, element = self.uses.limits.rows[k], int(self.uses.element[row, k])
        if limit.elements and element >= 0:
            return f"{limit.reads.removesuffix('_angle')}_{limit.elements[element]}"
        wheel = find_wheel(self.rows.prediction, self.uses, row, k)
        return WHEELS[wheel] if wheel >= 0 else ""

    def add_chance(self, chance: FailureChance | None) -> "PathLimits":
        """Return the limits with a lane for the chance that the path fails there, if known."""
        if chance is None:
            return self
        used = chance.at[self.rows.prediction.waypoint]
        return replace(self, lanes=(*self.lanes, Lane(CHANCE, "chance", used)))


def find_path_limits(rover: Rover, prediction: PathPrediction, verdict: Verdict) -> PathLimits:
    """Return how a prediction uses the limits, up to and including the first failure.

    Sinkage is left out where nothing sinks.

    Args:
        rover: The rover.
        prediction: The prediction of the path.
        verdict: The verdict on it; it also knows of refusals that no limit of a pose explains,
            such as entrapment and the worst case of an uncertain map.
    """
    if verdict.first_failure >= 0:
        prediction = prediction.cut(verdict.first_failure + 1)
    rows = merge_poses(prediction)
    uses = find_uses(limits_of(rover, prediction.policy), rows.prediction.results)
    of_code: dict[str, list[int]] = {}
    for k, row in enumerate(uses.limits.rows):
        of_code.setdefault(row.code, []).append(k)
    if not np.any(prediction.sinkage > 0.0):
        of_code.pop("sinkage", None)
    unjudged = np.where(rows.prediction.settled, 0.0, np.inf)
    lanes = [_make_lane(rows, uses, np.array(one)) for one in of_code.values()]
    found = PathLimits(rows, (Lane(GROUND, "ground", unjudged), *lanes), uses)
    _add_refusals(found, verdict)
    return found


def _make_lane(rows: AskedPoses, uses: Uses, of_limit: NDArray[np.int64]) -> Lane:
    """Return the lane of some rows of the table, of which that which is used most counts.

    It has a number if it is that of one row of the table.
    """
    prediction, every = rows.prediction, np.arange(len(rows.distance))
    numbered = [k for k in of_limit.tolist() if uses.limits.rows[k].has_number]
    k = (numbered or of_limit.tolist())[0]
    limit, bound = uses.limits.rows[k], uses.limits.bounds[k]
    asked = np.where(np.isnan(uses.use[:, of_limit]), -np.inf, uses.use[:, of_limit])
    decides = of_limit[asked.argmax(axis=1)]
    used = np.where(prediction.settled, uses.use[every, decides], np.nan)
    lane = Lane(limit.code, limit.title, used, decides=decides)
    if len(numbered) != 1 or limit.sense == Sense.RANGE:
        return lane
    unit, kept = limit.shown or limit.unit, np.ones(len(every))
    if limit.keeps_margin:
        kept = np.nan_to_num(prediction.results["kept_share"], nan=1.0)
    column, count = find_column(limit.reads)
    values = numbers_of(prediction.results)[:, column : column + count]
    wheels = None
    if count == len(WHEELS) and limit.sense == Sense.MOST:
        wheels = np.where(np.isnan(uses.use[:, [k]]), np.nan, values / (bound * kept)[:, None])
    nearest = values[every, np.maximum(uses.element[every, k], 0)]
    return replace(
        lane,
        values=unit.factor * np.where(decides == k, nearest, np.nan),
        bounds=unit.factor * bound * kept,
        unit=unit,
        is_lowest=limit.sense in (Sense.LEAST, Sense.SHARE),
        wheels=wheels,
    )


def _add_refusals(limits: PathLimits, verdict: Verdict) -> None:
    """Mark refusals of the verdict that no lane shows at their waypoints.

    A chance of failure has a lane of its own, as soon as it is known.
    """
    rows = limits.rows
    for waypoint in np.unique(rows.prediction.waypoint).tolist():
        code = verdict.codes[waypoint]
        lane, here = limits.lane(code), rows.prediction.waypoint == waypoint
        if code not in ("", CHANCE) and not np.any(lane.used[here] > 1.0):
            lane.used[here & ~rows.is_between] = ABOVE


def write(value: float, digits: int, unit: str = "") -> str:
    """Return a number as text with its unit, ? for NaN."""
    if np.isnan(value):
        return "?"
    return f"{value:.{digits}f} {unit}".rstrip() if abs(value) < HUGE else "infinite"


@dataclass(frozen=True, eq=False)
class Failure:
    """The first failure of a path."""

    code: str
    """Code of the verdict."""
    headline: str
    """The value beside the limit, such as "friction 1.32 of 1.00, middle left wheel"."""
    link: str
    """The link that fails: a name of WHEELS, BODY, rocker_left, bogie_right and so on; empty if
    it is none."""
    is_between: bool
    """True if it is between two waypoints."""
    row: int
    """Its row of the limits along the path."""
    state: RoverState
    """The rover there; a level one of unknown forces above the ground if it does not stand."""

    @property
    def place(self) -> str:
        """Where and when it is, in words."""
        between = ", between waypoints" if self.is_between else ""
        return f"after {self.state.distance:.2f} m, {self.state.time:.0f} s{between}"


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
    most = lane.used[broken] == lane.used[broken].max()  # what lanes and curves show as the worst
    at = int(min(broken[most], key=lambda row: rows.is_between[row]))
    # The worst case of an uncertain map may break a limit that the value itself keeps.
    above = 0.0 if lane.bounds is None else lane.values[at] - lane.bounds[at]
    explains = above < 0.0 if lane.is_lowest else above > 0.0
    here = rows.prediction.select([at])
    state = RoverState(rover, here, np.zeros(6))
    if not here.settled[0]:  # a level rover of unknown forces, above the ground below its origin
        x, y, yaw = here.poses[0].tolist()
        standing = rover.wheel.radius - rover.suspension.wheels["middle"][2]
        height = float(np.nan_to_num(terrain.elevation_at(x, y))) + standing
        driven = {"distance": rows.distance[at], "time": rows.time[at]}
        state = place_state(rover, np.array([x, y, height]), np.array([0.0, 0.0, yaw]), **driven)
    link = limits.find_link(lane, at) if explains or verdict.code == "suspension" else ""
    link = link or _find_link(terrain, verdict, state)
    of_ground = TITLES.get(verdict.code, verdict.code.replace("_", " "))
    words = lane.compare(at) if explains else of_ground if lane.code == GROUND else ""
    where = link.replace("_", " ") + (" wheel" if link in WHEELS else "")
    headline = ", ".join(filter(None, (words, where))) if words else verdict.reason
    return Failure(
        code=verdict.code,
        headline=headline.removeprefix(ON_THE_WAY),
        link=link,
        is_between=bool(rows.is_between[at]),
        row=at,
        state=state,
    )


def _find_link(terrain: Terrain, verdict: Verdict, state: RoverState) -> str:
    """Return the link that fails in a state where no lane names one; empty for none."""
    if verdict.code in BODY_CODES:
        return BODY
    if verdict.code not in ("off_map", "unknown_ground"):
        return next((name for name in WHEELS if name in verdict.reason), "")
    # The wheel with the most of its footprint beyond known ground.
    offsets = state.rover.wheel.radius * np.linspace(-1.0, 1.0, 5)
    x = state.wheel_centres[:, 0, None, None] + offsets[:, None]
    y = state.wheel_centres[:, 1, None, None] + offsets
    lost = ~np.isfinite(terrain.elevation_at(x + 0.0 * y, y + 0.0 * x)).reshape(6, -1)
    counts = lost.sum(axis=1)
    return WHEELS[int(np.argmax(counts))] if counts.any() else ""
