"""Safety limits held against a prediction: whether each waypoint is passable, and if not, why."""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from rover_physics.evaluation import NO_EQUILIBRIUM
from rover_physics.plain import to_plain
from rover_physics.prediction import PathPrediction
from rover_physics.reasons import check_limits, tilt_of
from rover_physics.rover import Rover
from rover_physics.settling import NOT_SETTLED, OFF_MAP, SETTLED, UNKNOWN_GROUND

CODES = (
    "off_map",
    "unknown_ground",
    "not_settled",
    "no_equilibrium",
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
UNNEEDED_IN_A_FALL = ("wheel_lift", "sinkage", "friction", "torque")
"""Limits that do not count while a wheel rolls off an edge."""
_PLACELESS = {
    OFF_MAP: ("off_map", "off the map: a wheel would leave the known area"),
    UNKNOWN_GROUND: ("unknown_ground", "unknown ground under a wheel"),
    NOT_SETTLED: (
        "not_settled",
        "no configuration found in which all six wheels touch the ground",
    ),
    NO_EQUILIBRIUM: ("no_equilibrium", "the wheel loads are not determined in this configuration"),
}


@dataclass(frozen=True)
class Verdict:
    """Whether a path is traversable, and the physical reason where it is not."""

    traversable: bool
    """True if every waypoint is passable."""
    reasons: tuple[str, ...]
    """For each waypoint the reason why it is not passable, empty where it is."""
    codes: tuple[str, ...]
    """For each waypoint one of CODES, empty where it is passable."""
    first_failure: int
    """Index of the first waypoint that is not passable, -1 if none."""
    code: str
    """Code of the first failure, empty if none."""
    reason: str
    """Reason of the first failure, empty if none."""
    policy: str
    """Torque policy that was assumed."""
    min_tip_over_ratio: float
    """Smallest tip-over ratio on the settled part of the path, NaN if none is settled."""
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
    """Standard deviations by which the heights of the map may be wrong; 0 where it is exact."""
    tip_over_ratio_bound: float = float("nan")
    """Smallest tip-over ratio that is possible then, NaN where the map is exact."""
    friction_utilisation_bound: float = float("nan")
    """Largest possible friction utilisation."""
    torque_saturation_bound: float = float("nan")
    """Largest possible torque saturation."""
    tilt_bound: float = float("nan")
    """Largest possible tilt of the body [rad]."""
    belly_clearance_bound: float = float("nan")
    """Smallest possible belly clearance [m]."""

    def to_dict(self) -> dict[str, Any]:
        """Return the verdict as JSON can hold it: lists for tuples, None for NaN and infinity."""
        return to_plain({field.name: getattr(self, field.name) for field in fields(self)})


def judge(rover: Rover, prediction: PathPrediction) -> Verdict:
    """Hold a prediction against the limits of the rover.

    The first limit broken, in the order of CODES, is the reason of a waypoint; a limit broken on
    the way to a waypoint counts there, unless the waypoint has a reason of its own.
    """
    codes, reasons = find_reasons(rover, prediction)
    parts = [prediction]
    if prediction.between is not None and len(prediction.between.poses):
        parts.append(prediction.between)
        owners = prediction.between.waypoint.tolist()
        on_the_way = zip(*find_reasons(rover, prediction.between), strict=True)
        for i, (code, reason) in zip(owners, on_the_way, strict=True):
            if code and not codes[i]:
                codes[i], reasons[i] = code, f"on the way here: {reason}"
    first: int = next((k for k, code in enumerate(codes) if code), -1)

    def extreme(choose, values_of) -> float:
        values = np.concatenate([np.ravel(values_of(part)) for part in parts])
        known = values[~np.isnan(values)]
        return float(choose(known)) if known.size else float("nan")

    return Verdict(
        traversable=first < 0,
        reasons=tuple(reasons),
        codes=tuple(codes),
        first_failure=first,
        code=codes[first] if first >= 0 else "",
        reason=reasons[first] if first >= 0 else "",
        policy=prediction.policy,
        min_tip_over_ratio=extreme(np.min, lambda part: part.tip_over_ratio),
        max_friction_utilisation=extreme(np.max, _needed_friction),
        max_torque_saturation=extreme(np.max, _needed_torque),
        max_tilt=extreme(np.max, tilt_of),
        min_belly_clearance=extreme(np.min, lambda part: part.belly_clearance),
        max_wheel_drop=extreme(np.max, lambda part: part.wheel_drop),
        max_sinkage=extreme(np.max, lambda part: part.sinkage),
    )


def _needed_friction(prediction: PathPrediction) -> np.ndarray:
    falls = np.asarray(prediction.falling.any(axis=1))
    return np.where(falls[:, None], np.nan, prediction.friction_utilisation)


def _needed_torque(prediction: PathPrediction) -> np.ndarray:
    falls = np.asarray(prediction.falling.any(axis=1))
    return np.where(falls[:, None], np.nan, prediction.torque_saturation)


def find_reasons(rover: Rover, prediction: PathPrediction) -> tuple[list[str], list[str]]:
    """Return code and reason of each row of a prediction, empty where passable."""
    n = len(prediction.poses)
    codes, reasons = [""] * n, [""] * n
    for i in np.flatnonzero(prediction.status != SETTLED).tolist():
        codes[i], reasons[i] = _PLACELESS[int(prediction.status[i])]
    falls = np.asarray(prediction.falling.any(axis=1))
    for check in check_limits(rover, prediction):
        broken = check.broken
        if check.code in UNNEEDED_IN_A_FALL:
            broken = broken & ~falls
        for i in np.flatnonzero(broken).tolist():
            if not codes[i]:
                codes[i], reasons[i] = check.code, check.describe(i)
    return codes, reasons
