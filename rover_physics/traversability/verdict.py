# SPDX-License-Identifier: Apache-2.0
"""Verdict on a prediction: whether each waypoint keeps the limits, and if not, why."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from rover_physics.chance.failure_chance import FailureChance
from rover_physics.limits import table
from rover_physics.limits.table import CHANCE, DEGREES, NOT_COMPUTABLE, TRAPPED, Sense
from rover_physics.names import WHEEL_POSITIONS, WHEELS
from rover_physics.numerics.arrays import Floats
from rover_physics.numerics.interruption import check_interruption
from rover_physics.numerics.plain_values import to_plain
from rover_physics.results.path_prediction import BOUNDED_VALUES, PathBounds, PathPrediction
from rover_physics.results.record import find_column, numbers_of
from rover_physics.results.uses import Uses, find_uses, limits_of
from rover_physics.rover.model import Rover
from rover_physics.status import BoundStatus, PoseStatus

UNSETTLED = {
    status: (status.name.lower(), reason)
    for status, reason in {
        PoseStatus.STEERING: "",
        PoseStatus.OFF_MAP: "off the map: a wheel would leave the known area",
        PoseStatus.UNKNOWN_GROUND: "unknown ground under a wheel",
        PoseStatus.NOT_SETTLED: "no configuration found in which all six wheels touch the ground",
        PoseStatus.NO_EQUILIBRIUM: "the wheel loads are not determined in this configuration",
        PoseStatus.NOT_COMPUTABLE: (
            "a wheel load, torque or margin cannot be computed: it is not a finite number"
        ),
    }.items()
}
"""Code and reason of the status of a row that is not settled; the reason of steering depends on
the row."""
_UNBOUNDED = {
    BoundStatus.ON_EDGE: ("not_settled", "a wheel may climb or fall off an edge"),
    BoundStatus.UNKNOWN_NEAR: ("unknown_ground", "a wheel may reach unknown ground"),
    BoundStatus.OFF_MAP_NEAR: ("off_map", "a wheel may leave the map"),
    BoundStatus.SINGULAR: ("no_equilibrium", "the wheel loads may not be determined"),
}
"""Code and reason of a pose without bounds."""
EXEMPT_ON_EDGE = ("friction_utilisation", "torque_saturation")
"""Quantities that do not count while a wheel rolls off an edge."""


@dataclass(frozen=True)
class Verdict:
    """Verdict on a path: traversable or not, with the physical reason if it is not."""

    traversable: bool
    """True if every waypoint is passable."""
    reasons: tuple[str, ...]
    """For each waypoint the reason why it is not passable, empty if it is."""
    codes: tuple[str, ...]
    """For each waypoint one of `codes_of_verdicts`, empty if it is passable."""
    first_failure: int
    """Index of the first waypoint that is not passable, -1 if none."""
    code: str
    """Code of the first failure, empty if none."""
    reason: str
    """Reason of the first failure, empty if none."""
    policy: str
    """Torque policy that was assumed."""
    min_tip_over_ratio: float
    """Smallest tip-over ratio on the settled part of the path, NaN if no pose is settled."""
    max_friction_utilisation: float
    """Largest friction utilisation on the settled part."""
    max_torque_saturation: float
    """Largest torque saturation on the settled part."""
    max_tilt: float
    """Largest tilt of the body on the settled part [rad]."""
    min_belly_clearance: float
    """Smallest belly clearance on the settled part [m]."""
    max_wheel_drop: float
    """Largest drop of a wheel that rolled off an edge [m]."""
    max_sinkage: float
    """Largest sinkage of a wheel on the settled part [m]; 0 on ground that does not yield."""
    risk: float = 0.0
    """Largest use of the limits that count as risk, on the way and, on an uncertain map, in the
    worst case; 1 is at a limit. Paths of equal length are compared by it."""
    map_sigmas: float = 0.0
    """Number of standard deviations by which the map's heights may be wrong; 0 if it is exact."""
    tip_over_ratio_bound: float = float("nan")
    """Smallest possible tip-over ratio within these standard deviations, NaN if none is known."""
    friction_utilisation_bound: float = float("nan")
    """Largest possible friction utilisation, NaN if none is known."""
    torque_saturation_bound: float = float("nan")
    """Largest possible torque saturation, NaN if none is known."""
    tilt_bound: float = float("nan")
    """Largest possible tilt of the body [rad], NaN if none is known."""
    belly_clearance_bound: float = float("nan")
    """Smallest possible belly clearance [m], NaN if none is known."""
    failure_chance: float = float("nan")
    """Chance that the path fails anywhere, 0 to 1; NaN if it was not asked."""
    failure_chance_at: tuple[float, ...] = ()
    """For each waypoint the chance that it fails there; empty if it was not asked."""

    def to_dict(self) -> dict[str, Any]:
        """Return the verdict as JSON types: lists for tuples, None for NaN and infinity."""
        return to_plain({field.name: getattr(self, field.name) for field in fields(self)})


_FIELDS = tuple(one.name for one in fields(Verdict))
EXTREMES = {
    name: (name.removeprefix(worst), worse)
    for name in _FIELDS
    for worst, worse in (("min_", np.fmin), ("max_", np.fmax))
    if name.startswith(worst)
}
"""Fields of a verdict that are the extreme of a quantity, as their names say: the quantity, and
which of two values is worse."""
WORSE = dict(EXTREMES.values())
"""The same by the quantity."""
BOUND_EXTREMES = {
    name: WORSE[name.removesuffix("_bound")] for name in _FIELDS if name.endswith("_bound")
}
"""Fields that are the worst case on an uncertain map, and which of two values is worse."""


def codes_of_verdicts() -> tuple[str, ...]:
    """Return the codes of a verdict; the first that applies is the reason of a waypoint."""
    of_limits = dict.fromkeys(limit.code for limit in table.LIMITS)
    return (*(code for code, _ in UNSETTLED.values()), *of_limits, TRAPPED, CHANCE)


def hold_against_limits(rover: Rover, prediction: PathPrediction) -> Verdict:
    """Return the verdict on a prediction.

    The reason of a waypoint is the first broken limit in the order of the table. A limit broken on
    the way to a waypoint counts there if the waypoint itself keeps all limits.
    """
    limits = limits_of(rover, prediction.policy)
    n = len(prediction.poses)
    codes, reasons, extremes, risk = [""] * n, [""] * n, dict[str, Any](), 0.0
    for part in (prediction, prediction.between):
        if part is None or not len(part.poses):
            continue
        uses = find_uses(limits, part.results)
        for row, (code, reason) in explain_rows(rover, part, uses).items():
            waypoint = int(part.waypoint[row])
            if not codes[waypoint]:
                where = "" if part is prediction else "on the way here: "
                codes[waypoint], reasons[waypoint] = code, f"{where}{reason}"
        for name, value in _find_extremes(part).items():
            extremes[name] = float(EXTREMES[name][1](value, extremes.get(name, np.nan)))
        risk = max(risk, find_largest_risk(uses, part.settled))
    return Verdict(**_sum_up(codes, reasons), policy=prediction.policy, risk=risk, **extremes)


def explain_rows(
    rover: Rover, prediction: PathPrediction, uses: Uses
) -> dict[int, tuple[str, str]]:
    """Return code and reason of each row that does not pass, in the order of the rows."""
    first = uses.find_first()
    found: dict[int, tuple[str, str]] = {}
    statuses = prediction.status.tolist()
    for row in np.flatnonzero((first >= 0) | ~prediction.settled).tolist():
        check_interruption()
        if statuses[row] == PoseStatus.SETTLED:
            found[row] = explain_use(prediction, uses, row, int(first[row]))
            continue
        code, reason = UNSETTLED[statuses[row]]
        found[row] = code, reason or _explain_steering(rover, prediction.steering_angle[row])
    return found


def explain_use(prediction: PathPrediction, uses: Uses, row: int, k: int) -> tuple[str, str]:
    """Return code and reason of limit k, which a settled row breaks."""
    limit, bound = uses.limits.rows[k], uses.limits.bounds[k]
    element = int(uses.element[row, k])
    numbers = numbers_of(prediction.results)[row]
    value = float(numbers[find_column(limit.reads)[0] + element])
    if np.isnan(value):
        quantity = limit.reads.replace("_", " ")
        return NOT_COMPUTABLE, f"{quantity} cannot be computed: it is not a number"
    if limit.sense == Sense.RANGE:
        bound = bound[0] if value < bound[0] else bound[1]
    margin = 1.0 - float(prediction.results["kept_share"][row]) if limit.keeps_margin else 0.0
    reason = limit.words.format(
        element=(limit.elements or WHEELS)[element],
        value=limit.unit.write(value),
        compared=limit.unit.compare(value, bound * (1.0 - margin)),
        policy=prediction.policy,
    )
    named = f" ({bound:g} less control margin {margin:g})" if margin > 0.0 else ""
    return limit.code, f"{reason}{named}"


def find_largest_risk(uses: Uses, settled: np.ndarray) -> float:
    """Return the largest use of the limits that count as risk at the settled rows, 0 for none."""
    counts = uses.limits.records["is_risk"] > 0
    return float(np.fmax.reduce(uses.use[settled][:, counts], axis=None, initial=0.0))


def refuse_chance(verdict: Verdict, chance: FailureChance, accepted: float) -> Verdict:
    """Return the verdict with the chance of failure, refused where that is above `accepted`.

    A path that is trapped fails for sure.
    """
    trapped = np.array([code == TRAPPED for code in verdict.codes])
    at, path = np.where(trapped, 1.0, chance.at), 1.0 if trapped.any() else chance.path
    known = replace(verdict, failure_chance=path, failure_chance_at=tuple(at.tolist()))
    if not verdict.traversable or path <= accepted:
        return known
    worst, codes, reasons = int(at.argmax()), list(verdict.codes), list(verdict.reasons)
    codes[worst], least = CHANCE, "" if chance.is_whole else "at least "
    cause = f"by the limit of {chance.limit}" if chance.limit else "where it does not settle"
    reasons[worst] = (
        f"the path passes as told, but fails with a chance of {least}{path:.2f} by what is "
        f"uncertain, accepted {accepted:g}: most often here, {at[worst]:.2f}, {cause}"
    )
    return with_refusals(known, codes, reasons)


def refuse_worst_case(
    rover: Rover, prediction: PathPrediction, bounds: PathBounds, verdict: Verdict
) -> Verdict:
    """Add the refusals of the bounds to a verdict; its own refusals remain.

    Args:
        rover: The rover, with its limits.
        prediction: The prediction that was bounded.
        bounds: Its bounds.
        verdict: The verdict on the prediction itself.

    Returns:
        The verdict with the additional refusals and the extremes of the bounds. An additional
        reason contains "at worst" or "within ... sigma of the map".
    """
    codes, reasons = list(verdict.codes), list(verdict.reasons)
    within = f"within {bounds.sigmas:g} sigma of the map"
    worst, risk = _find_worst(rover, prediction, bounds)
    for i, (code, reason) in worst.items():
        if not codes[i]:
            codes[i], reasons[i] = code, f"{reason}, at worst {within}"
    for i, status in enumerate(bounds.status.tolist()):
        if not codes[i] and status in _UNBOUNDED:
            codes[i], what = _UNBOUNDED[status]
            reasons[i] = f"{what} {within}"
    falls = np.asarray(prediction.falling.any(axis=1))
    needed = bounds.bounded & ~falls
    for name in BOUNDED_VALUES:
        # Where the value itself is not known, as the clearance over unknown ground, no bound is.
        missing = np.isnan(getattr(bounds, name)).any(axis=-1) & ~np.isnan(
            getattr(prediction, name)
        )
        for i in np.flatnonzero(needed & missing.reshape(len(needed), -1).any(axis=1)).tolist():
            if not codes[i]:
                codes[i] = NOT_COMPUTABLE
                reasons[i] = f"{name} cannot be computed {within}: a bound is not a number"
    extremes: dict[str, Any] = {}
    for name, worse in BOUND_EXTREMES.items():
        quantity, end = name.removesuffix("_bound"), 0 if worse is np.fmin else 1
        rows = needed if quantity in EXEMPT_ON_EDGE else bounds.bounded
        values = getattr(bounds, quantity)[rows][..., end]
        extremes[name] = float(worse.reduce(values, axis=None)) if values.size else np.nan
    refused = with_refusals(verdict, codes, reasons)
    risk = max(verdict.risk, risk)
    return replace(refused, risk=risk, map_sigmas=bounds.sigmas, **extremes)


def _find_worst(
    rover: Rover, prediction: PathPrediction, bounds: PathBounds
) -> tuple[dict[int, tuple[str, str]], float]:
    """Return code and reason of the rows that break a limit in the worst case, and their risk."""

    def at(end: int, *names: str) -> dict[str, Floats]:
        found = {}
        for name in names:
            values = getattr(bounds, name)[..., end]
            found[name] = np.where(np.isnan(values), getattr(prediction, name), values)
        return found

    joints = "rocker_angle", "bogie_angle"
    worst = prediction.change(
        roll=_largest(prediction.roll, bounds.roll),
        pitch=_largest(prediction.pitch, bounds.pitch),
        **at(0, *joints, "belly_clearance", "tip_over_ratio", "wheel_loads"),
        **at(1, "friction_utilisation", "torque_saturation", "sinkage"),
    )
    limits, found, risk = limits_of(rover, prediction.policy), dict[int, tuple[str, str]](), 0.0
    for part in (worst, worst.change(**at(1, *joints))):
        uses = find_uses(limits, part.results)
        for row, refusal in explain_rows(rover, part, uses).items():
            if row not in found or refusal[0] == "suspension":
                found[row] = refusal
        risk = max(risk, find_largest_risk(uses, part.settled))
    return found, risk


def _largest(value: Floats, bounds: Floats) -> Floats:
    """Return the end of each interval (n, 2) farther from 0; the value (n,) where it is NaN."""
    rows = np.arange(len(bounds))
    farther = bounds[rows, np.argmax(np.abs(bounds), axis=1)]
    return np.where(np.isnan(farther), value, farther)


def with_refusals(verdict: Verdict, codes: Sequence[str], reasons: Sequence[str]) -> Verdict:
    """Return a verdict with other codes and reasons of its waypoints."""
    return replace(verdict, **_sum_up(codes, reasons))


def _sum_up(codes: Sequence[str], reasons: Sequence[str]) -> dict[str, Any]:
    """Return the fields of a verdict that follow from codes and reasons of its waypoints."""
    first = next((i for i, code in enumerate(codes) if code), -1)
    return {
        "traversable": first < 0,
        "reasons": tuple(reasons),
        "codes": tuple(codes),
        "first_failure": first,
        "code": codes[first] if first >= 0 else "",
        "reason": reasons[first] if first >= 0 else "",
    }


def worst_of(verdict: Verdict, other: Verdict) -> Verdict:
    """Return a verdict with the worse of two verdicts' extremes; the rest is the second's."""
    worse = (
        {name: choose for name, (_, choose) in EXTREMES.items()}
        | BOUND_EXTREMES
        | {"risk": np.fmax}
    )
    extremes = {
        name: float(choose(getattr(verdict, name), getattr(other, name)))
        for name, choose in worse.items()
    }
    return replace(other, **extremes)  # type: ignore[arg-type]


def _find_extremes(prediction: PathPrediction) -> dict[str, float]:
    """Return the EXTREMES of a prediction; NaN where no row has the quantity."""
    falls = prediction.falling.any(axis=1)
    found = {}
    for name, (quantity, worse) in EXTREMES.items():
        values = getattr(prediction, quantity)
        if quantity in EXEMPT_ON_EDGE and falls.any():
            values = values[~falls]
        found[name] = float(worse.reduce(values, axis=None)) if values.size else np.nan
    return found


def _explain_steering(rover: Rover, angles: np.ndarray) -> str:
    """Return why wheels cannot point as angles (6,) [rad] ask."""
    steering = rover.steering
    assert steering is not None
    turns = np.tile([position in steering.wheels for position in WHEEL_POSITIONS], 2)
    wheel = int(np.argmax(np.abs(angles) - np.where(turns, steering.limit, 0.0)))
    if turns[wheel]:
        compared = DEGREES.compare(float(angles[wheel]), steering.limit)
        return f"{WHEELS[wheel]} wheel needs a steering angle of {compared}"
    aside = DEGREES.write(float(angles[wheel]))
    return f"{WHEELS[wheel]} wheel does not steer: the way leads {aside} aside of its heading"
