"""Wheels that roll off an edge: where they fall, and how far they drop.

A wheel whose contact lies behind it, steeper than friction holds, rolls and slides down whatever
the motors do. Until it lands there is no equilibrium and none is needed; how far it drops is a
result.
"""

import numpy as np

from rover_physics.crossing import HEIGHT_JUMP, SHORTEST, Crossings
from rover_physics.evaluation import Columns

LEAST_ANGLE = np.radians(15.0)
"""A wheel falls only from contacts at least this steep, however slippery they are."""
MOST_FALLING = 2
"""One axle at a time may fall; more is a rover sliding down a slope."""


def find_falling(contact_angle: np.ndarray, friction: np.ndarray) -> np.ndarray:
    """Return (n, 6) True for wheels that roll off an edge.

    Args:
        contact_angle: (n, 6) contact angles, positive in front [rad], NaN where not settled.
        friction: (n, 6) friction coefficients.
    """
    held_by_friction = np.arctan(np.nan_to_num(friction, nan=1.0))
    falling = contact_angle < -np.maximum(held_by_friction, LEAST_ANGLE)
    others = np.where(falling, np.nan, contact_angle)
    count = np.maximum((~falling).sum(axis=1), 1)
    downhill = np.nansum(others, axis=1) / count < -0.5 * held_by_friction.min(axis=1)
    falling[downhill | (falling.sum(axis=1) > MOST_FALLING)] = False
    return falling


def find_drops(
    radius: float, poses: np.ndarray, columns: Columns, crossings: Crossings
) -> np.ndarray:
    """Return (n, 6) how far each wheel has dropped when it comes to a waypoint [m]."""
    n = len(poses)
    order = np.argsort(np.concatenate([np.arange(n), crossings.place]), kind="stable")
    between = crossings.columns
    heights = np.concatenate([columns.centres[:, :, 2], between.centres[:, :, 2]])[order]
    angles = np.concatenate([columns.contact_angle, between.contact_angle])[order]
    mu = np.concatenate([columns.friction, between.friction])[order]
    where = np.concatenate([poses, crossings.poses])[order, :2]
    owner = np.concatenate([np.arange(n), crossings.waypoint])[order]
    falling = find_falling(angles, mu)
    steps = np.hypot(*np.diff(where, axis=0).T)
    descents = np.nan_to_num(np.maximum(-np.diff(heights, axis=0), 0.0))
    sudden = (descents > HEIGHT_JUMP * radius) & (steps[:, None] <= 2.0 * SHORTEST)
    dropping = falling[:-1] | falling[1:] | sudden
    drops = np.zeros((n, 6))
    fallen = np.zeros(6)
    for k in range(len(descents)):
        fallen = np.where(dropping[k], fallen + descents[k], 0.0)
        drops[owner[k + 1]] = np.maximum(drops[owner[k + 1]], fallen)
    return drops
