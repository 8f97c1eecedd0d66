# SPDX-License-Identifier: Apache-2.0
"""What the verdict took from between waypoints, and what it did not ask, in sentences."""

import numpy as np

from rover_physics.limits.table import LIMITS
from rover_physics.names import SERVO, WHEELS
from rover_physics.numerics.arrays import Floats
from rover_physics.results.path_prediction import PathPrediction

MAX_PLACES = 3
"""Most places that are named in a sentence."""
NEAR = 0.1
"""Distance up to which exempt rows are one place [m]."""


def tell_exemptions(prediction: PathPrediction, waypoints: int) -> tuple[str, ...]:
    """Return what a reader of plots and reasons should know of the first waypoints of a path.

    One sentence on the friction utilisation between waypoints where it is larger than at all of
    them, and one on the places where a wheel rolls off an edge.
    """
    own = prediction.select(slice(waypoints))
    parts = [own]
    if prediction.between is not None and len(prediction.between.poses):
        parts.append(prediction.between.select(prediction.between.waypoint < waypoints))
    told = _tell_largest(own, parts[1:]) if prediction.policy != SERVO else ""
    return tuple(filter(None, (told, _tell_falls(own, parts))))


def _tell_largest(own: PathPrediction, between: list[PathPrediction]) -> str:
    """Return the largest utilisation between waypoints; empty if it is not the largest."""
    for part in between:
        worst = _largest_of_rows(part)
        if not worst.size or not worst.max() > _largest_of_rows(own).max(initial=0.0):
            continue
        row = int(np.argmax(worst))
        wheel = WHEELS[int(np.nanargmax(part.friction_utilisation[row]))].replace("_", " ")
        place = own.distance[part.waypoint[row]]
        exempt = ", not asked: a wheel rolls off an edge" if part.falling[row].any() else ""
        return (
            f"between waypoints the utilisation reaches {worst[row]:.2f} ({wheel}, on the way to "
            f"{place:.2f} m{exempt})"
        )
    return ""


def _largest_of_rows(part: PathPrediction) -> Floats:
    """Return the largest utilisation (n,) of each row; 0 where the rover does not settle."""
    largest = np.fmax.reduce(part.friction_utilisation, axis=1)
    return np.where(part.settled, np.nan_to_num(largest, posinf=np.inf), 0.0)


def _tell_falls(own: PathPrediction, parts: list[PathPrediction]) -> str:
    """Return where wheels roll off edges, and which limits are not asked there."""
    found: dict[str, list[float]] = {}
    for part in parts:
        for row, wheel in np.argwhere(part.falling).tolist():
            name = WHEELS[wheel].replace("_", " ")
            found.setdefault(name, []).append(float(own.distance[part.waypoint[row]]))
    places: dict[str, list[str]] = {}
    for name, distances in found.items():
        for start, end in _stretches(sorted(distances)):
            place = f"at {end:.2f} m" if end - start < 0.005 else f"{start:.2f} to {end:.2f} m"
            places.setdefault(place, []).append(name)
    if not places:
        return ""
    limits = [
        code.replace("_", " ")
        for code in dict.fromkeys(row.code for row in LIMITS if row.rests_in_a_fall)
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
