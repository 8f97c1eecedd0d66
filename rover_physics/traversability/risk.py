"""How near a path comes to the safety limits: the tightest one, and the exposure to all."""

from typing import NamedTuple

import numpy as np

from rover_physics.names import SERVO
from rover_physics.numerics.kernels import exact_kernel
from rover_physics.prediction.path_prediction import PathPrediction
from rover_physics.rover.model import Rover
from rover_physics.traversability.verdict import Verdict

SAFE = 0.5
"""Used share of a limit up to which there is no exposure."""


class RiskLimits(NamedTuple):
    """Limits of a rover, as kernels read them."""

    friction_utilisation: float
    """Largest; infinite with speed servos."""
    torque_saturation: float
    """Largest; infinite with speed servos."""
    tilt: float
    """Largest [rad]."""
    tip_over_ratio: float
    """Smallest."""
    belly_clearance: float
    """Smallest [m]."""


def risk_limits_of(rover: Rover, policy: str) -> RiskLimits:
    """Return the limits that count as risk under a policy.

    Speed servos use all friction and torque of a wheel wherever the ground is uneven: no risk.
    """
    limits = rover.limits
    on_servos = policy == SERVO
    return RiskLimits(
        np.inf if on_servos else limits.friction_utilisation,
        np.inf if on_servos else limits.torque_saturation,
        limits.tilt,
        limits.tip_over_ratio,
        limits.belly_clearance,
    )


def used_share(rover: Rover, verdict: Verdict) -> float:
    """Return the used share of the tightest safety limit of a judged path; 1 is at the limit.

    The share is value over limit for friction utilisation, torque saturation and tilt, which have
    maxima. It is limit over value for tip-over ratio and belly clearance, which have minima. On an
    uncertain map the values are the bounds.
    """
    limits = risk_limits_of(rover, verdict.policy)
    friction = np.fmax(verdict.max_friction_utilisation, verdict.friction_utilisation_bound)
    torque = np.fmax(verdict.max_torque_saturation, verdict.torque_saturation_bound)
    tilt = np.fmax(verdict.max_tilt, verdict.tilt_bound)
    tip_over = np.fmin(verdict.min_tip_over_ratio, verdict.tip_over_ratio_bound)
    belly = np.fmin(verdict.min_belly_clearance, verdict.belly_clearance_bound)
    return float(
        max(
            friction / limits.friction_utilisation,
            torque / limits.torque_saturation,
            tilt / limits.tilt,
            limits.tip_over_ratio / max(tip_over, 1e-9),
            limits.belly_clearance / max(belly, 1e-9),
        )
    )


def find_exposure(rover: Rover, prediction: PathPrediction) -> float:
    """Return the exposure [s]: the integral over time of the squared excess over SAFE.

    The excess is (used share - SAFE) / (1 - SAFE), 0 below SAFE and 1 at the limit and beyond.
    """
    limits = risk_limits_of(rover, prediction.policy)
    upright = np.cos(prediction.roll) * np.cos(prediction.pitch)
    shares = np.fmax.reduce(
        [
            prediction.friction_utilisation.max(axis=1) / limits.friction_utilisation,
            prediction.torque_saturation.max(axis=1) / limits.torque_saturation,
            np.arccos(np.clip(upright, -1.0, 1.0)) / limits.tilt,
            limits.tip_over_ratio / np.fmax(prediction.tip_over_ratio, 1e-9),
            limits.belly_clearance / np.fmax(prediction.belly_clearance, 1e-9),
        ]
    )
    excess = np.clip((shares - SAFE) / (1.0 - SAFE), 0.0, 1.0) ** 2
    return float(np.sum(0.5 * (excess[1:] + excess[:-1]) * np.diff(prediction.time)))


@exact_kernel
def add_exposure(results, time, limits):
    """Return the exposure [s] as `find_exposure`; `time` (n,) [s] is that of the RESULTs (n,)."""
    exposure, before = 0.0, 0.0
    for row in range(results.size):
        here = _squared_excess(results[row], limits)
        if row > 0:
            exposure += 0.5 * (before + here) * (time[row] - time[row - 1])
        before = here
    return exposure


@exact_kernel
def _squared_excess(result, limits):
    """Return the squared excess over SAFE at a RESULT."""
    upright = np.cos(result.q[1]) * np.cos(result.q[2])
    share = np.arccos(min(max(upright, -1.0), 1.0)) / limits.tilt
    share = max(share, limits.tip_over_ratio / max(result.tip_over_ratio, 1e-9))
    if result.belly_clearance == result.belly_clearance:
        share = max(share, limits.belly_clearance / max(result.belly_clearance, 1e-9))
    for wheel in range(6):
        share = max(share, result.friction_utilisation[wheel] / limits.friction_utilisation)
        share = max(share, result.torque_saturation[wheel] / limits.torque_saturation)
    return min(max((share - SAFE) / (1.0 - SAFE), 0.0), 1.0) ** 2
