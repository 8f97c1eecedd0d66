# SPDX-License-Identifier: Apache-2.0
"""Comparison of predictions to the last bit."""

from rover_physics import PathPrediction
from rover_physics.results.record import RESULT


def assert_same(one: PathPrediction, other: PathPrediction) -> None:
    """Check that poses, waypoints and all results are the same."""
    for name in ("poses", "waypoint"):
        assert getattr(one, name).tobytes() == getattr(other, name).tobytes(), name
    for name in RESULT.names:
        assert one.results[name].tobytes() == other.results[name].tobytes(), name
