# SPDX-License-Identifier: Apache-2.0
"""Sentences on what the verdict took from between waypoints, and on what it did not ask."""

import numpy as np

from rover_physics.limits.table import LIMITS
from rover_physics.names import SERVO, WHEELS
from rover_physics.numerics.arrays import Floats
from rover_physics.results.path_prediction import PathPrediction
from rover_planner.viewer.state.path_limits import AskedPoses, merge_poses

MAX_PLACES = 3
"""Most places that are named in a sentence."""
NEAR = 0.1
"""Distance up to which exempt rows are one place [m]."""


def describe_exemptions(prediction: PathPrediction, waypoints: int) -> tuple[str, ...]:
    """Return what a reader of plots and reasons should know of the first waypoints of a path.

    One sentence on the friction utilisation between waypoints where it is larger than at all of
    them, and one on the places where a wheel rolls off an edge.
    """
    if not waypoints:
        return ()
    rows = merge_poses(prediction.cut(waypoints))
    next_waypoint = prediction.distance[rows.prediction.waypoint]
    largest = "" if prediction.policy == SERVO else _describe_largest(rows, next_waypoint)
    return tuple(filter(None, (largest, _describe_edges(rows, next_waypoint))))


def _describe_largest(rows: AskedPoses, on_the_way_to: Floats) -> str:
    """Return the largest utilisation between waypoints; empty if it is not the largest."""
    part = rows.prediction
    largest = np.fmax.reduce(part.friction_utilisation, axis=1)
    largest = np.where(part.settled, np.nan_to_num(largest, posinf=np.inf), 0.0)
    between = np.where(rows.is_between, largest, -np.inf)
    if not between.max(initial=-np.inf) > largest[~rows.is_between].max(initial=0.0):
        return ""
    row = int(np.argmax(between))
    wheel = WHEELS[int(np.nanargmax(part.friction_utilisation[row]))].replace("_", " ")
    exempt = ", not asked: a wheel rolls off an edge" if part.falling[row].any() else ""
    return (
        f"between waypoints the utilisation reaches {largest[row]:.2f} ({wheel}, on the way to "
        f"{on_the_way_to[row]:.2f} m{exempt})"
    )


def _describe_edges(rows: AskedPoses, on_the_way_to: Floats) -> str:
    """Return where wheels roll off edges, and which limits are not asked there."""
    found: dict[str, list[float]] = {}
    for row, wheel in np.argwhere(rows.prediction.falling).tolist():
        found.setdefault(WHEELS[wheel].replace("_", " "), []).append(float(on_the_way_to[row]))
    places: dict[str, list[str]] = {}
    for name, distances in found.items():
        for start, end in _stretches(sorted(distances)):
            place = f"at {end:.2f} m" if end - start < 0.005 else f"{start:.2f} to {end:.2f} m"
            places.setdefault(place, []).append(name)
    if not places:
        return ""
    limits = [
        code.replace("_", " ")
        for code in dict.fromkeys(row.code for row in LIMITS if row.exempt_on_edge)
    ]
    shown = "; ".join(
        f"{' and '.join(sorted(names))} {place}"
        for place, names in list(places.items())[:MAX_PLACES]
    )
    more = f" and {len(places) - MAX_PLACES} more" if len(places) > MAX_PLACES else ""
    return (
        f"not asked while a wheel rolls off an edge: {', '.join(limits[:-1])} and {limits[-1]} "
        f"({shown}{more})"
    )


def _stretches(distances: list[float]) -> list[tuple[float, float]]:
    """Return first and last of distances that follow each other within NEAR [m]."""
    ends = np.flatnonzero(np.diff(distances) > NEAR) + 1
    return [(float(one[0]), float(one[-1])) for one in np.split(np.array(distances), ends)]
