# SPDX-License-Identifier: Apache-2.0
"""Judged paths and their rover: verdicts, uses of the limits, board, sliders, and what differs."""

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_physics.chance.failure_chance import FailureChance
from rover_physics.limits.table import CHANCE
from rover_physics.names import EQUAL, OPTIMAL, SERVO, WHEELS
from rover_physics.numerics.arrays import Floats
from rover_physics.numerics.plain_values import to_plain
from rover_physics.rover.model import Rover
from rover_physics.rover.rover_file import rover_to_dict
from rover_planner.studies.rover_values import RoverValue, get_value, list_values
from rover_planner.viewer.state.colours import colour_use, to_css
from rover_planner.viewer.state.drive import RoverState
from rover_planner.viewer.state.path_limits import ON_THE_WAY, write
from rover_planner.viewer.state.scenario import JudgedPath, Scenario, Shown

POLICY_TITLES = {EQUAL: "equal torques", SERVO: "speed servos", OPTIMAL: "traction control"}
"""Names of the torque policies on the page."""
WORDS = {None: "no verdict", True: "traversable", False: "not traversable"}
MAX_USE = 99.0
"""Largest use that is written as a number."""
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
JOINTS = "joints"
"""First key of the angle of a joint, which is no number of the rover file."""
FULL_TURN = 3.15
"""Largest angle, both ways, of the slider of an arm's joint without limits [rad]."""
SAME = 1e-9
"""Difference up to which two numbers are the same."""


def describe_subject(scenario: Scenario, ground: str) -> dict[str, str]:
    """Return what a scenario is about, by name, on a ground with a name."""
    rover, terrain, options = scenario.rover, scenario.terrain, scenario.options
    soil = options.model.soil or f"firm, friction {rover.friction:g}"
    if terrain.soil_names:
        soil = f"{', '.join(terrain.soil_names)} on the map"
    return {
        "rover": rover.name + ("" if rover == scenario.loaded else " (changed)"),
        "map": ground,
        "soil": soil,
        "torques": POLICY_TITLES[options.model.policy],
        "mode": "planning" if scenario.recorded is None else "replay",
    }


def describe_verdict(shown: Shown) -> dict[str, Any]:
    """Return the verdict on the path that is looked at."""
    failure, verdict, chance = shown.path.failure, shown.verdict, ""
    if shown.chance is not None:
        cause = f", most often by {shown.chance.limit}" if shown.chance.limit else ""
        chance = f"chance of failure {100.0 * shown.chance.path:.0f} %{cause}"
    reason, around = verdict.reason, shown.around
    if failure is not None and failure.is_between and not reason.startswith(ON_THE_WAY):
        reason = f"at the next waypoint: {reason}"  # of which a worse place comes before
    closed = "" if around is None or around.path is not None else around.reason
    return {
        **describe_answer(verdict.traversable, f"path {shown.index + 1} of {len(shown.paths)}"),
        "headline": "" if failure is None else failure.headline,
        "where": "" if failure is None else failure.place,
        "chance": chance,
        "details": [*filter(None, (reason, closed))],
        "policies": _list_policies(shown),
        "offers": _list_offers(shown),
        "fails": failure is not None,
    }


def describe_answer(traversable: bool | None, about: str) -> dict[str, Any]:
    """Return a bare verdict: what it says and what it is about."""
    return {"passes": traversable, "word": WORDS[traversable], "about": about}


def _list_policies(shown: Shown) -> list[dict[str, Any]]:
    """Return the verdicts under all policies; none for a replay, whose soil is not known."""
    rows = []
    for policy, title in POLICY_TITLES.items() if shown.scenario.recorded is None else ():
        values, one = shown.by_policy.get(policy, (None, ""))
        if policy == shown.verdict.policy:
            values, one = shown.scenario, shown.verdict
        passes, reason = (None, one) if isinstance(one, str) else (one.traversable, one.reason)
        old = values is not shown.scenario
        word = {None: "not judged", True: "passes", False: "refused"}[passes]
        row = {"title": title, "word": word, "passes": passes, "old": old}
        rows.append({**row, "reason": reason or word})
    return rows


def _list_offers(shown: Shown) -> Sequence[dict[str, Any]]:
    """Return what a click takes instead of a path that is refused: words, and what it asks."""
    if shown.offer is None:
        return []
    around = "" if shown.offer < shown.generated else "goes around and "
    length = shown.paths[shown.offer].length
    words = f"path {shown.offer + 1} {around}passes ({length:.1f} m)"
    return [{"words": words, "ask": {"ask": "show", "index": shown.offer}}]


def describe_paths(
    shown: Shown, is_outdated: bool = False, is_judging: bool = False
) -> dict[str, Any]:
    """Return a row for each path; the numbers of a refused one are up to its first failure.

    Args:
        shown: What is shown.
        is_outdated: True if other values are wanted than those of what is shown.
        is_judging: True if something is judged; else old paths say that they wait.
    """
    every = frozenset(range(len(shown.paths)))
    old = every if is_outdated else shown.old
    waits = "old, is judged" if is_judging else "old, was not judged again"
    rows = []
    for k, path in enumerate(shown.paths):
        verdict, limits, length = path.verdict, path.limits, f"{path.length:.2f}"
        end = limits.rows.distance[-1]
        uses = [float(np.nanmax(one.used, initial=0.0)) for one in limits.lanes]
        word = "passes" if verdict.traversable else "refused"
        rows.append(
            {
                "number": k + 1,
                "passes": verdict.traversable,
                "word": f"{word}, best" if k == shown.best else word,
                "waits": waits if k in old else "",
                "length": length if verdict.traversable else f"{end:.2f} of {length}",
                "energy": write(path.trajectory.energy, 1),
                "use": write_use(max(uses)),
                "limit": limits.lanes[int(np.argmax(uses))].title,
                "reason": verdict.reason,
            }
        )
    return {"rows": rows, "shown": shown.index}


def describe_limits(
    path: JudgedPath, reference: JudgedPath | None, chance: FailureChance | None = None
) -> dict[str, Any]:
    """Return the curves of a path's lanes, those of the reference, of its chance, and the loads.

    A lane has the use now and before, and six curves where wheels have it. Loads are those of the
    wheels [N] while the rover stands.
    """
    failure, before = path.failure, None if reference is None else reference.limits
    limits = path.limits.add_chance(chance)
    end = max(float(one.rows.distance[-1]) for one in (limits, before) if one is not None)
    rows, stands = limits.rows, limits.rows.prediction.settled
    lanes = []
    for lane in limits.lanes:
        old = None
        if before is not None and lane.code != CHANCE:
            old = _pick_points(before.rows.distance, before.lane(lane.code).used[:, None])
        now = _pick_points(rows.distance, lane.used[:, None])
        wheels = None if lane.wheels is None else _pick_points(rows.distance, lane.wheels)
        told = {"code": lane.code, "title": lane.title, "now": now, "before": old}
        lanes.append({**told, "wheels": wheels})
    loads = rows.prediction.wheel_loads[stands]
    return {
        "end": round(end, 4),
        "code": "" if failure is None else limits.lane(failure.code).code,
        "compared": reference is not None,
        "lanes": lanes,
        "loads": _pick_points(rows.distance[stands], loads, 1),
    }


def describe_uses(
    path: JudgedPath, time: float, chance: FailureChance | None = None
) -> list[dict[str, Any]]:
    """Return for each lane its use at a time [s] and the worst so far, with value and wheel."""
    limits, failure = path.limits.add_chance(chance), path.failure
    rows = max(int(np.searchsorted(limits.rows.time, time + 1e-6, side="right")), 1)
    here = rows - 1
    if failure is not None and time >= failure.state.time - 1e-6:
        rows, here = max(rows, failure.row + 1), failure.row
    uses = []
    for lane in limits.lanes:
        known = np.where(np.isnan(lane.used[:rows]), -np.inf, lane.used[:rows])
        worst = int(np.argmax(known))
        used = float(lane.used[worst])  # NaN if nothing is known there
        link = limits.find_link(lane, worst).replace("_", " ") if used > 0.0 else ""
        value = "" if np.isnan(used) else lane.write_value(worst)
        now = write_use(float(lane.used[here]))
        told = {"now": now, "worst": write_use(used), "broken": used > 1.0}
        uses.append({**told, "value": value, "link": link})
    if chance is not None:
        of = "whole path" if failure is None or failure.code == CHANCE else "up to the failure"
        uses[-1]["value"] = f"{of} {100.0 * chance.path:.0f} %"
        uses[-1]["broken"] = failure is not None and failure.code == CHANCE
    return uses


def _pick_points(distance: Floats, values: Floats, digits: int = 3) -> dict[str, Any]:
    """Return x (j,) and curves y (k, j) of values (m, k) with all peaks and dips.

    What is infinite is MAX_USE: a use without bound is above the limit, no gap.
    """
    rows = choose_rows(values)
    y = np.where(np.isposinf(values[rows]), MAX_USE, values[rows]).T
    return {"x": to_plain(np.round(distance[rows], 4)), "y": to_plain(np.round(y, digits))}


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


def describe_board(state: RoverState | None, failing: str = "") -> dict[str, Any] | None:
    """Return the wheels in wheel order, and the numbers of a state; None without a state.

    Args:
        state: The rover; slip is told where wheels slip, on yielding soil or with servos.
        failing: The link that fails, empty for none.
    """
    if state is None:
        return None
    wheels, slips = [], np.nan_to_num(state.slip_ratio).any()
    for k, name in enumerate(WHEELS):
        friction, torque = float(state.friction_use[k]), float(state.torque_use[k])
        bars = (("friction", friction), ("torque", torque))
        slip = abs(float(state.slip_ratio[k]))
        wheels.append(
            {
                "name": name.replace("_", " "),
                "bars": [[title, to_plain(round(use, 3)), write_use(use)] for title, use in bars],
                "colour": to_css(colour_use(friction)),
                "load": write(float(state.wheel_loads[k]), 1, "N"),
                "slip": write(100.0 * slip, 0, "% slip") if slips else "",
                "turn": to_plain(np.round(np.degrees(state.steering_angle[k]), 1)),
                "fails": failing == name,
            }
        )
    numbers = {
        "time": write(state.time, 1, "s"),
        "distance": write(100.0 * state.distance, 1, "cm"),
        "speed": write(100.0 * float(np.hypot(*state.motion[:2])), 1, "cm/s"),
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


# The rover's numbers, and what differs from the reference.


def list_sliders(rover: Rover) -> dict[str, list[RoverValue]]:
    """Return the changeable numbers of a rover by part; the last are the angles of its arm."""
    parts, arm = list_values(rover), rover.manipulator
    if arm is not None:
        ends = arm.joint_limits or ((-FULL_TURN, FULL_TURN),) * 3
        parts["Arm"] = [
            RoverValue(((JOINTS, name),), f"{name} [rad]", low, high, 0.01)
            for name, (low, high) in zip(arm.joints, ends, strict=True)
        ]
    return parts


def describe_sliders(scenario: Scenario) -> list[dict[str, Any]]:
    """Return sliders by part: label, ends, step and the value of the rover as loaded."""
    loaded = read_values(scenario.as_loaded())
    return [
        {
            "title": title,
            "sliders": [[k.label, k.low, k.high, k.step, loaded[k.label]] for k in values],
        }
        for title, values in list_sliders(scenario.loaded).items()
    ]


def read_values(scenario: Scenario) -> dict[str, float]:
    """Return the numbers of a scenario by the label of their slider."""
    data = {**rover_to_dict(scenario.rover), JOINTS: scenario.arm}
    parts = list_sliders(scenario.loaded).values()
    return {one.label: get_value(data, one.keys[0]) for values in parts for one in values}


def describe_changes(
    path: JudgedPath, reference: JudgedPath | None, is_kept: bool
) -> dict[str, Any]:
    """Return what differs from the reference: numbers of the rover and the arm, and the drive."""
    if reference is None:
        return {"kept": is_kept, "rover": [], "drive": []}
    before, now = read_values(reference.scenario), read_values(path.scenario)
    rows = [
        [label, f"{before[label]:g}", f"{value:g}"]
        for label, value in now.items()
        if abs(value - before[label]) > SAME
    ]
    was, here = (one.scenario.options.model for one in (reference, path))
    if was.policy != here.policy:
        rows.append(["torques", POLICY_TITLES[was.policy], POLICY_TITLES[here.policy]])
    if was.soil != here.soil:
        rows.append(["soil", was.soil or "none", here.soil or "none"])
    return {"kept": is_kept, "rover": rows, "drive": compare_drives(reference, path)}


def compare_drives(before: JudgedPath, now: JudgedPath) -> list[list[str]]:
    """Return name, value before and now of the drives along one path, up to their failures."""
    reads: Mapping[str, Callable[[JudgedPath], str]] = {
        "verdict": lambda one: "passes" if one.verdict.traversable else "refused",
        "driven": lambda one: write(float(one.trajectory.distance[-1]), 2, "m"),
        "time": lambda one: write(float(one.trajectory.times[-1]), 1, "s"),
        "energy": lambda one: write(one.trajectory.energy, 1, "J"),
    }
    rows = [[name, read(before), read(now)] for name, read in reads.items()]
    for lane in now.limits.lanes:
        uses = [
            write_use(float(np.fmax.reduce(one.limits.lane(lane.code).used)))
            for one in (before, now)
        ]
        rows.append([lane.title, *uses])
    return [row for row in rows if row[0] == "verdict" or row[1] != row[2]]


# Numbers.


def write_use(use: float) -> str:
    """Return the use of a limit as text, such as "76 %"."""
    if np.isnan(use):
        return "not asked"
    if use > MAX_USE:
        return "fails" if np.isinf(use) else f"over {100.0 * MAX_USE:.0f} %"
    text = f"{100.0 * use:.0f} %"
    return "just above 100 %" if use > 1.0 and text == "100 %" else text
