"""Verdict on a prediction: whether each waypoint keeps the safety limits, and if not, why."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from rover_physics.names import WHEEL_POSITIONS, WHEELS
from rover_physics.numerics.interruption import check_interruption
from rover_physics.numerics.plain_values import to_plain
from rover_physics.prediction.path_prediction import PathPrediction
from rover_physics.rover.model import Rover
from rover_physics.status import PoseStatus
from rover_physics.traversability.check import NOT_COMPUTABLE, compare, largest_of
from rover_physics.traversability.limit_checks import check_limits

CODES = (
    "steering",
    "off_map",
    "unknown_ground",
    "not_settled",
    "no_equilibrium",
    "not_computable",
    "suspension",
    "tilt",
    "tip_over",
    "wheel_lift",
    "sinkage",
    "friction",
    "torque",
    "wheel_drop",
    "belly",
    "trapped",
)
"""Codes of a verdict; the first that applies is the reason of a waypoint."""
MARGIN_CODES = ("friction", "torque")
"""Codes of the limits that a control margin reduces; their reasons name it."""
UNNEEDED_IN_A_FALL = ("wheel_lift", "sinkage", "friction", "torque")
"""Codes of limits that do not count while a wheel rolls off an edge."""
LOWEST = (
    "min_tip_over_ratio",
    "min_belly_clearance",
    "tip_over_ratio_bound",
    "belly_clearance_bound",
)
"""Fields of a verdict that are the smallest value on the path."""
LARGEST = (
    "max_friction_utilisation",
    "max_torque_saturation",
    "max_tilt",
    "max_wheel_drop",
    "max_sinkage",
    "friction_utilisation_bound",
    "torque_saturation_bound",
    "tilt_bound",
)
"""Fields of a verdict that are the largest value on the path."""
_LOWER_LIMITS = ("tip_over", "wheel_lift", "belly")
"""Codes of limits that are lower bounds."""
_PLACELESS = {
    PoseStatus.OFF_MAP: ("off_map", "off the map: a wheel would leave the known area"),
    PoseStatus.UNKNOWN_GROUND: ("unknown_ground", "unknown ground under a wheel"),
    PoseStatus.NOT_SETTLED: (
        "not_settled",
        "no configuration found in which all six wheels touch the ground",
    ),
    PoseStatus.NO_EQUILIBRIUM: (
        "no_equilibrium",
        "the wheel loads are not determined in this configuration",
    ),
    PoseStatus.NOT_COMPUTABLE: (
        NOT_COMPUTABLE,
        "a wheel load, torque or margin cannot be computed: it is not a finite number",
    ),
}


@dataclass(frozen=True)
class Verdict:
    """Whether a path is traversable, and the physical reason if it is not."""

    traversable: bool
    """True if every waypoint is passable."""
    reasons: tuple[str, ...]
    """For each waypoint the reason why it is not passable, empty if it is."""
    codes: tuple[str, ...]
    """For each waypoint one of CODES, empty if it is passable."""
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

    def to_dict(self) -> dict[str, Any]:
        """Return the verdict as JSON types: lists for tuples, None for NaN and infinity."""
        return to_plain({field.name: getattr(self, field.name) for field in fields(self)})


def judge(rover: Rover, prediction: PathPrediction) -> Verdict:
    """Compare a prediction with the limits of the rover.

    The reason of a waypoint is the first broken limit in the order of CODES. A limit broken on the
    way to a waypoint counts there if the waypoint itself keeps all limits.
    """
    found, extremes = _hold_against_limits(rover, prediction)
    between = prediction.between
    if between is not None and len(between.poses):
        on_the_way, others = _hold_against_limits(rover, between)
        for row in sorted(on_the_way):
            code, reason = on_the_way[row]
            found.setdefault(int(between.waypoint[row]), (code, f"on the way here: {reason}"))
        extremes = {
            code: float((np.fmin if code in _LOWER_LIMITS else np.fmax)(value, others[code]))
            for code, value in extremes.items()
        }
    first = min(found, default=-1)
    code, reason = found.get(first, ("", ""))
    codes, reasons = _spread_out(found, len(prediction.poses))
    return Verdict(
        traversable=first < 0,
        reasons=tuple(reasons),
        codes=tuple(codes),
        first_failure=first,
        code=code,
        reason=reason,
        policy=prediction.policy,
        min_tip_over_ratio=extremes["tip_over"],
        max_friction_utilisation=extremes["friction"],
        max_torque_saturation=extremes["torque"],
        max_tilt=extremes["tilt"],
        min_belly_clearance=extremes["belly"],
        max_wheel_drop=extremes["wheel_drop"],
        max_sinkage=extremes["sinkage"],
    )


def find_first_failure(rover: Rover, prediction: PathPrediction) -> int:
    """Return the first failure that `judge` finds, -1 if there is none, without the reasons."""
    first = len(prediction.poses)
    for part in (prediction, prediction.between):
        if part is None or not len(part.poses):
            continue
        broken = part.status != PoseStatus.SETTLED
        needed = _where_forces_count(part)
        for check in check_limits(rover, part):
            if check.breaks:
                counts = needed if check.code in UNNEEDED_IN_A_FALL else True
                broken = broken | (check.broken() & part.settled & counts)
        first = min(first, int(part.waypoint[broken].min(initial=first)))
    return first if first < len(prediction.poses) else -1


def forgive(verdict: Verdict, other: Verdict) -> Verdict:
    """Return a verdict without its refusals of waypoints that another verdict does not refuse.

    Args:
        verdict: The verdict.
        other: The verdict on the same path under another policy.
    """
    refused = [bool(code) for code in other.codes]
    codes = [code if keep else "" for code, keep in zip(verdict.codes, refused, strict=True)]
    reasons = [text if keep else "" for text, keep in zip(verdict.reasons, refused, strict=True)]
    return with_refusals(verdict, codes, reasons)


def name_margin(verdict: Verdict, physical: Verdict, margin: float) -> Verdict:
    """Return a verdict whose refusals that are due to its control margin alone say so.

    Args:
        verdict: The verdict with a control margin.
        physical: The verdict on the same path without one.
        margin: The control margin.
    """
    waypoints = [
        i
        for i, code in enumerate(verdict.codes)
        if code and code not in MARGIN_CODES and not physical.codes[i]
    ]
    return name_margin_at(verdict, waypoints, margin)


def name_margin_at(verdict: Verdict, waypoints: Sequence[int], margin: float) -> Verdict:
    """Return a verdict that names the control margin as the reason of some waypoints' refusals."""
    codes, reasons = list(verdict.codes), list(verdict.reasons)
    for i in waypoints:
        codes[i] = "torque"
        reasons[i] = f"no torques within their limit less control margin {margin:g}"
    return with_refusals(verdict, codes, reasons)


def with_refusals(verdict: Verdict, codes: Sequence[str], reasons: Sequence[str]) -> Verdict:
    """Return a verdict with other codes and reasons of its waypoints."""
    first = next((i for i, code in enumerate(codes) if code), -1)
    return replace(
        verdict,
        traversable=first < 0,
        codes=tuple(codes),
        reasons=tuple(reasons),
        first_failure=first,
        code=codes[first] if first >= 0 else "",
        reason=reasons[first] if first >= 0 else "",
    )


def worst_of(verdict: Verdict, other: Verdict) -> Verdict:
    """Return a verdict with the worse of two verdicts' extremes; the rest is the second's."""
    extremes = {name: float(np.fmin(getattr(verdict, name), getattr(other, name)))
                for name in LOWEST}  # fmt: skip
    extremes |= {name: float(np.fmax(getattr(verdict, name), getattr(other, name)))
                 for name in LARGEST}  # fmt: skip
    return replace(other, **extremes)  # type: ignore[arg-type]


def find_reasons(rover: Rover, prediction: PathPrediction) -> tuple[list[str], list[str]]:
    """Return code and reason of each row of a prediction, empty if passable."""
    return _spread_out(_hold_against_limits(rover, prediction)[0], len(prediction.poses))


def _spread_out(found: dict[int, tuple[str, str]], n: int) -> tuple[list[str], list[str]]:
    """Return code and reason of each of n rows, empty if none was found."""
    codes, reasons = [""] * n, [""] * n
    for row, (code, reason) in found.items():
        codes[row], reasons[row] = code, reason
    return codes, reasons


def _hold_against_limits(
    rover: Rover, prediction: PathPrediction
) -> tuple[dict[int, tuple[str, str]], dict[str, float]]:
    """Return code and reason of the impassable rows, and the extreme value of each limit."""
    found = {
        row: _explain_status(rover, prediction, row)
        for row in np.flatnonzero(prediction.status != PoseStatus.SETTLED).tolist()
    }
    settled = prediction.settled
    checks = check_limits(rover, prediction)
    extremes = {check.code: check.extreme for check in checks}
    needed = _where_forces_count(prediction)
    for check in checks:
        if check.breaks:
            counts = needed if check.code in UNNEEDED_IN_A_FALL else True
            for row in np.flatnonzero(check.broken() & settled & counts).tolist():
                if row not in found:
                    check_interruption()
                    found[row] = check.explain(row)
    if needed is not True:
        extremes["friction"] = largest_of(prediction.friction_utilisation[needed])
        extremes["torque"] = largest_of(prediction.torque_saturation[needed])
    return found, extremes


def _explain_status(rover: Rover, prediction: PathPrediction, row: int) -> tuple[str, str]:
    """Return code and reason of a row that is not settled."""
    status = PoseStatus(prediction.status[row])
    if status != PoseStatus.STEERING:
        return _PLACELESS[status]
    angles, steering = prediction.steering_angle[row], rover.steering
    assert steering is not None
    turns = np.tile([position in steering.wheels for position in WHEEL_POSITIONS], 2)
    wheel = int(np.argmax(np.abs(angles) - np.where(turns, steering.limit, 0.0)))
    angle, limit = np.degrees(angles[wheel]), np.degrees(steering.limit)
    if turns[wheel]:
        needed = f"needs a steering angle of {compare(angle, limit, 1, ' deg')}"
    else:
        needed = f"does not steer: the way leads {angle:.1f} deg aside of its heading"
    return "steering", f"{WHEELS[wheel]} wheel {needed}"


def _where_forces_count(prediction: PathPrediction) -> np.ndarray | bool:
    """Return (n,) False where a wheel rolls off an edge, or a single True if none ever does."""
    falling = prediction.falling
    return ~np.asarray(falling.any(axis=1)) if falling.any() else True
