"""How near a path or a piece of it comes to the safety limits."""

from typing import NamedTuple

import numpy as np

from rover_physics.names import SERVO
from rover_physics.rover.model import Rover
from rover_physics.traversability.verdict import Verdict


class Extremes(NamedTuple):
    """Values nearest to the limits, or furthest beyond them."""

    friction_utilisation: float
    """Largest of any wheel; 0 with speed servos."""
    torque_saturation: float
    """Largest of any wheel; 0 with speed servos."""
    tilt: float
    """Largest [rad]."""
    tip_over_ratio: float
    """Smallest."""
    belly_clearance: float
    """Smallest [m]; NaN if the ground below is not known."""


def extremes_of(verdict: Verdict) -> Extremes:
    """Return the extremes of a judged path; on an uncertain map they are the bounds.

    Speed servos use all friction and torque of a wheel wherever the ground is uneven. That is no
    risk, so both are 0 for them.
    """
    use = 0.0 if verdict.policy == SERVO else 1.0
    return Extremes(
        use * float(np.fmax(verdict.max_friction_utilisation, verdict.friction_utilisation_bound)),
        use * float(np.fmax(verdict.max_torque_saturation, verdict.torque_saturation_bound)),
        float(np.fmax(verdict.max_tilt, verdict.tilt_bound)),
        float(np.fmin(verdict.min_tip_over_ratio, verdict.tip_over_ratio_bound)),
        float(np.fmin(verdict.min_belly_clearance, verdict.belly_clearance_bound)),
    )


def used_share(rover: Rover, extremes: Extremes) -> float:
    """Return the used share of the tightest safety limit; 1 is at the limit.

    The share is value over limit for friction utilisation, torque saturation and tilt, which have
    maxima. It is limit over value for tip-over ratio and belly clearance, which have minima.
    """
    limits = rover.limits
    return max(
        extremes.friction_utilisation / limits.friction_utilisation,
        extremes.torque_saturation / limits.torque_saturation,
        extremes.tilt / limits.tilt,
        limits.tip_over_ratio / max(extremes.tip_over_ratio, 1e-9),
        limits.belly_clearance / max(extremes.belly_clearance, 1e-9),
    )
