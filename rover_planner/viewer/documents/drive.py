# SPDX-License-Identifier: Apache-2.0
"""A drive: the uses of the limits along it, beside those of the reference, and the board."""

import itertools
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_physics.chance.failure_chance import FailureChance
from rover_physics.limits.table import CHANCE
from rover_physics.names import WHEELS
from rover_physics.numerics.arrays import Floats
from rover_planner.viewer.state.colours import colour_use, to_css
from rover_planner.viewer.state.drive import RoverState
from rover_planner.viewer.state.numbers import MAX_USE, plain, write, write_use
from rover_planner.viewer.state.path_limits import Lane, PathLimits
from rover_planner.viewer.state.scenario import Judged

MAX_POINTS = 240
"""Most points of a curve."""
WHEEL_ROWS = {
    "normal force N [N]": ("wheel_loads", 1.0, 1),
    "traction T [N]": ("tangential", 1.0, 1),
    "lateral force S [N]": ("lateral", 1.0, 1),
    "use of friction [%]": ("friction_use", 100.0, 0),
    "use of torque [%]": ("torque_use", 100.0, 0),
    "slip ratio [%]": ("slip_ratio", 100.0, 0),
}
"""Rows of the table of wheels: field of the state, factor and digits."""


def describe_limits(
    path: Judged, reference: Judged | None, chance: FailureChance | None = None
) -> dict[str, Any]:
    """Return the curves of a path's lanes, those of the reference, of its chance, and the loads.

    A lane has the use now and before, and six curves where wheels have it. Loads are those of the
    wheels [N] while the rover stands.
    """
    failure, before = path.failure, None if reference is None else reference.limits
    limits = path.limits.add_chance(chance)
    end = max(limits.end, 0.0 if before is None else before.end)
    rows, stands = limits.rows, limits.rows.prediction.settled
    lanes = []
    for lane in limits.lanes:
        code, old = lane.code, None
        if before is not None and code != CHANCE:
            old = _pick_points(before.rows.distance, before.lane(code).used[:, None])
        lanes.append(
            {
                "code": code,
                "title": lane.title,
                "now": _pick_points(rows.distance, lane.used[:, None]),
                "wheels": None
                if lane.wheels is None
                else _pick_points(rows.distance, lane.wheels),
                "before": old,
            }
        )
    loads = rows.prediction.wheel_loads[stands]
    return {
        "end": round(end, 4),
        "code": "" if failure is None else limits.lane(failure.code).code,
        "compared": reference is not None,
        "lanes": lanes,
        "loads": _pick_points(rows.distance[stands], loads, 1),
    }


def describe_uses(
    path: Judged, time: float, chance: FailureChance | None = None
) -> list[dict[str, Any]]:
    """Return for each lane its use at a time [s] and the worst so far, with value and wheel."""
    limits, failure = path.limits.add_chance(chance), path.failure
    rows = limits.rows_until(time)
    here = rows - 1
    if failure is not None and failure.is_reached(time):
        rows, here = max(rows, failure.row + 1), failure.row
    uses = [_describe_use(lane, limits, lane.worst_until(rows), here) for lane in limits.lanes]
    if chance is not None:
        of = "whole path" if failure is None or failure.code == CHANCE else "up to the failure"
        uses[-1]["value"] = f"{of} {100.0 * chance.path:.0f} %"
        uses[-1]["broken"] = failure is not None and failure.code == CHANCE
    return uses


def write_chance(chance: FailureChance) -> str:
    """Return the chance that a path fails, and its main cause, in words."""
    cause = f", most often by {chance.limit}" if chance.limit else ""
    return f"{100.0 * chance.path:.0f} %{cause}"


def _describe_use(lane: Lane, limits: PathLimits, worst: int, here: int) -> dict[str, Any]:
    used = float(lane.used[worst]) if worst >= 0 else np.nan
    return {
        "now": write_use(float(lane.used[here])),
        "worst": write_use(used),
        "broken": bool(used > 1.0),
        "value": lane.write_value(worst) if worst >= 0 else "",
        "link": limits.find_link(lane, worst).replace("_", " ") if used > 0.0 else "",
    }


def _pick_points(distance: Floats, values: Floats, digits: int = 3) -> dict[str, Any]:
    """Return x (j,) and curves y (k, j) of values (m, k) with all peaks and dips.

    What is infinite is MAX_USE: a use without bound is above the limit, no gap.
    """
    rows = choose_rows(values)
    y = np.where(np.isposinf(values[rows]), MAX_USE, values[rows]).T
    return {"x": plain(distance[rows], 4), "y": plain(y, digits)}


def choose_rows(values: Floats) -> NDArray[np.intp]:
    """Return at most MAX_POINTS rows of curves (m, k): first, last, and all peaks and dips.

    A peak between two waypoints is what refuses a path; it must not be left out.
    """
    m = len(values)
    if m <= MAX_POINTS:
        return np.arange(m)
    edges = np.linspace(0, m, MAX_POINTS // 2).astype(int)
    high = np.nan_to_num(values, nan=-1e9).max(axis=1)
    low = np.nan_to_num(values, nan=1e9).min(axis=1)
    chosen = [
        first + int(pick)
        for first, end in itertools.pairwise(edges)
        for pick in (np.argmax(high[first:end]), np.argmin(low[first:end]))
    ]
    return np.unique([0, *chosen, m - 1])


def describe_board(
    state: RoverState | None, failing: str = "", *, has_slip: bool = False
) -> dict[str, Any] | None:
    """Return the wheels in wheel order, and the numbers of a state; None without a state.

    Args:
        state: The rover.
        failing: The link that fails, empty for none.
        has_slip: True if slip is predicted, on yielding soil or with speed servos.
    """
    if state is None:
        return None
    wheels = []
    for k, name in enumerate(WHEELS):
        friction, torque = float(state.friction_use[k]), float(state.torque_use[k])
        bars = (("friction", friction), ("torque", torque))
        slip = abs(float(state.slip_ratio[k]))
        wheels.append(
            {
                "name": name.replace("_", " "),
                "bars": [[title, plain(use), write_use(use)] for title, use in bars],
                "colour": to_css(colour_use(friction)),
                "load": write(float(state.wheel_loads[k]), 1, "N"),
                "slip": write(100.0 * slip, 0, "% slip") if has_slip else "",
                "turn": plain(math.degrees(float(state.steering_angle[k])), 1),
                "fails": failing == name,
            }
        )
    numbers = {
        "time": write(state.time, 1, "s"),
        "distance": write(100.0 * state.distance, 1, "cm"),
        "speed": write(100.0 * state.speed, 1, "cm/s"),
        "energy": write(state.energy, 2, "J"),
        "tilt": write(math.degrees(state.tilt), 1, "deg"),
        "belly": write(100.0 * state.belly_clearance, 1, "cm"),
        "margin": write(state.tip_over_ratio, 2),
        "x, y": f"{state.position[0]:.2f}, {state.position[1]:.2f} m",
    }
    table = [
        [title, [write(scale * float(value), digits) for value in getattr(state, name)]]
        for title, (name, scale, digits) in WHEEL_ROWS.items()
    ]
    return {"wheels": wheels, "numbers": numbers, "table": table}
