"""Safety limits held against a prediction: whether each waypoint is passable, and if not, why."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from rover_physics.evaluation import NO_EQUILIBRIUM
from rover_physics.names import SIDES, WHEELS
from rover_physics.prediction import PathPrediction
from rover_physics.rover import Rover
from rover_physics.settling import NOT_SETTLED, OFF_MAP, UNKNOWN_GROUND

CODES = (
    "off_map",
    "unknown_ground",
    "not_settled",
    "no_equilibrium",
    "suspension",
    "tilt",
    "tip_over",
    "wheel_lift",
    "friction",
    "torque",
    "belly",
)
_PLACELESS = {
    OFF_MAP: ("off_map", "off the map: a wheel would leave the known area"),
    UNKNOWN_GROUND: ("unknown_ground", "unknown ground under a wheel"),
    NOT_SETTLED: (
        "not_settled",
        "no configuration found in which all six wheels touch the ground",
    ),
    NO_EQUILIBRIUM: ("no_equilibrium", "the wheel loads are not determined in this configuration"),
}
_TOLERANCE = 1e-9


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

    def to_dict(self) -> dict[str, Any]:
        """Return the verdict as plain numbers and texts that JSON can hold; NaN and infinity as None."""
        plain = asdict(self)
        plain["reasons"], plain["codes"] = list(self.reasons), list(self.codes)
        return {key: _plain(value) for key, value in plain.items()}


def _plain(value: Any) -> Any:
    return None if isinstance(value, float) and not np.isfinite(value) else value


def tilt_of(prediction: PathPrediction) -> np.ndarray:
    """Return the angle (n,) [rad] between the body's z axis and the vertical."""
    upright = np.cos(prediction.roll) * np.cos(prediction.pitch)
    return np.arccos(np.clip(upright, -1.0, 1.0))


def judge(rover: Rover, prediction: PathPrediction) -> Verdict:
    """Hold a prediction against the limits of the rover.

    The first limit broken, in the order of CODES, is the reason of a waypoint.
    """
    n = len(prediction.poses)
    codes, reasons = [""] * n, [""] * n
    for i, status in enumerate(prediction.status.tolist()):
        if status in _PLACELESS:
            codes[i], reasons[i] = _PLACELESS[status]
    for code, broken, describe in _checks(rover, prediction):
        for i in np.flatnonzero(broken):
            if not codes[i]:
                codes[i], reasons[i] = code, describe(i)
    first = next((i for i, code in enumerate(codes) if code), -1)
    return Verdict(
        traversable=first < 0,
        reasons=tuple(reasons),
        codes=tuple(codes),
        first_failure=first,
        code=codes[first] if first >= 0 else "",
        reason=reasons[first] if first >= 0 else "",
        policy=prediction.policy,
        min_tip_over_ratio=_extreme(np.min, prediction.tip_over_ratio),
        max_friction_utilisation=_extreme(np.max, prediction.friction_utilisation),
        max_torque_saturation=_extreme(np.max, prediction.torque_saturation),
        max_tilt=_extreme(np.max, tilt_of(prediction)),
        min_belly_clearance=_extreme(np.min, prediction.belly_clearance),
    )


def _extreme(choose, values: np.ndarray) -> float:
    known = values[~np.isnan(values)]
    return float(choose(known)) if known.size else float("nan")


def _checks(rover: Rover, prediction: PathPrediction):
    """Return for each limit its code, where it is broken (n,), and a description of waypoint i."""
    limits, suspension = rover.limits, rover.suspension
    tilt = tilt_of(prediction)
    ratio = prediction.tip_over_ratio
    loads, used = prediction.wheel_loads, prediction.friction_utilisation
    saturation, belly = prediction.torque_saturation, prediction.belly_clearance

    def worst(values: np.ndarray, i: int) -> tuple[str, float]:
        wheel = int(np.argmax(values[i]))
        return WHEELS[wheel], float(values[i, wheel])

    def describe_tilt(i: int) -> str:
        return f"tilt {np.degrees(tilt[i]):.1f} deg, limit {np.degrees(limits.tilt):.1f} deg"

    def describe_tip_over(i: int) -> str:
        return f"tip-over ratio {ratio[i]:.2f}, limit {limits.tip_over_ratio:.2f}"

    def describe_lift(i: int) -> str:
        name, lift = worst(-loads, i)
        return f"{name} wheel lifts off: load {-lift:.2f} N under {prediction.policy} torques"

    def describe_friction(i: int) -> str:
        name, value = worst(used, i)
        return (
            f"{name} wheel slips: friction utilisation {value:.2f}, "
            f"limit {limits.friction_utilisation:.2f}"
        )

    def describe_torque(i: int) -> str:
        name, value = worst(saturation, i)
        return f"{name} motor saturates: torque {value:.2f} of its limit {limits.torque_saturation:.2f}"

    def describe_belly(i: int) -> str:
        return f"belly clearance {belly[i]:.3f} m, limit {limits.belly_clearance:.3f} m"

    joints = np.hstack([prediction.rocker_angle, prediction.bogie_angle])
    low = np.repeat([suspension.rocker_limits[0], suspension.bogie_limits[0]], 2)
    high = np.repeat([suspension.rocker_limits[1], suspension.bogie_limits[1]], 2)
    beyond = (joints < low - _TOLERANCE) | (joints > high + _TOLERANCE)

    def describe_suspension(i: int) -> str:
        joint = int(np.argmax(beyond[i]))
        name = f"{SIDES[joint % 2]} {('rocker', 'bogie')[joint // 2]}"
        return f"{name} angle {joints[i, joint]:.2f} rad, limits {low[joint]:.2f} to {high[joint]:.2f} rad"

    settled = prediction.settled
    return [
        ("suspension", settled & beyond.any(axis=1), describe_suspension),
        ("tilt", tilt > limits.tilt + _TOLERANCE, describe_tilt),
        ("tip_over", ratio < limits.tip_over_ratio - _TOLERANCE, describe_tip_over),
        ("wheel_lift", (loads < 0.0).any(axis=1), describe_lift),
        ("friction", _above(used, limits.friction_utilisation), describe_friction),
        ("torque", _above(saturation, limits.torque_saturation), describe_torque),
        ("belly", belly < limits.belly_clearance - _TOLERANCE, describe_belly),
    ]


def _above(values: np.ndarray, limit: float) -> np.ndarray:
    return (values > limit + _TOLERANCE).any(axis=1)
