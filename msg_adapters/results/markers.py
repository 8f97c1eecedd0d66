# SPDX-License-Identifier: Apache-2.0
"""Writes markers for RViz: the path coloured by class, its first failure, wheel contacts."""

from collections.abc import Sequence

import numpy as np
from geometry_msgs.msg import Point
from numpy.typing import NDArray
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from rover_physics.numerics.quaternions import xyzw_from_yaw
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.traversability import classification

GREEN = ColorRGBA(r=0.10, g=0.70, b=0.30, a=1.0)
LIME = ColorRGBA(r=0.65, g=0.80, b=0.15, a=1.0)
ORANGE = ColorRGBA(r=0.95, g=0.65, b=0.10, a=1.0)
RED = ColorRGBA(r=0.85, g=0.15, b=0.10, a=1.0)
BLUE = ColorRGBA(r=0.15, g=0.35, b=0.85, a=0.8)

_COLOURS = {
    classification.PASSABLE: GREEN,
    classification.WITH_SPEED_SERVOS: LIME,
    classification.WITH_TRACTION_CONTROL: ORANGE,
    classification.IMPASSABLE: RED,
}
_LINE_WIDTH = 0.05
_CONTACT_SIZE = 0.04
_TEXT_HEIGHT = 0.2
_TEXT_ABOVE = 0.6


def path_markers(
    prediction: PathPrediction,
    reasons: Sequence[str],
    rows: NDArray[np.intp],
    header: Header,
    waypoint_classes: Sequence[str] = (),
) -> MarkerArray:
    """Return markers of a judged path; the first one deletes the markers drawn before.

    Args:
        prediction: Prediction of n waypoints.
        reasons: (n,) reason why each waypoint is not passable, empty if passable.
        rows: Indices of waypoints to draw; the first failing waypoint is always drawn.
        header: Frame of the map, and stamp.
        waypoint_classes: (n,) classes, which set the colours; without them the reasons do.
    """
    markers = cleared_markers(header)
    positions = _drawable_positions(prediction)
    failures = [i for i, reason in enumerate(reasons) if reason]
    rows = np.unique(np.concatenate([rows, failures[:1]]).astype(np.intp))
    outcomes = [(reasons[i], waypoint_classes[i] if waypoint_classes else "") for i in rows]
    path = _marker("path", Marker.LINE_STRIP, header, (_LINE_WIDTH, 0.0, 0.0))
    path.points = _points(positions[rows])
    path.colors = [_colour(*outcome) for outcome in outcomes]
    contacts = prediction.contact_points[rows[prediction.settled[rows]]].reshape(-1, 3)
    spheres = _marker("contact_points", Marker.SPHERE_LIST, header, 3 * (_CONTACT_SIZE,), BLUE)
    spheres.points = _points(contacts[np.isfinite(contacts).all(axis=1)])
    markers.markers += [path, spheres]
    for first in failures[:1]:
        arrow = _marker("failing_pose", Marker.ARROW, header, (0.6, 0.1, 0.1), RED)
        text = _marker("reason", Marker.TEXT_VIEW_FACING, header, (0.0, 0.0, _TEXT_HEIGHT), RED)
        arrow.pose.position, text.pose.position = _points(positions[[first, first]])
        turn = arrow.pose.orientation
        turn.x, turn.y, turn.z, turn.w = xyzw_from_yaw(float(prediction.poses[first, 2]))
        text.pose.position.z += _TEXT_ABOVE
        text.text = reasons[first]
        markers.markers += [arrow, text]
    return markers


def _colour(reason: str, traversability_class: str) -> ColorRGBA:
    """Return the colour of a waypoint by its class, or by its reason if the class is unknown."""
    return _COLOURS[traversability_class] if traversability_class else RED if reason else GREEN


def cleared_markers(header: Header) -> MarkerArray:
    """Return a marker that deletes all markers drawn before."""
    marker = _marker("", Marker.CUBE, header, (0.0, 0.0, 0.0))
    marker.action = Marker.DELETEALL
    return MarkerArray(markers=[marker])


def _marker(
    namespace: str,
    kind: int,
    header: Header,
    size: tuple[float, float, float],
    colour: ColorRGBA | None = None,
) -> Marker:
    """Return a marker that stays until the next path is drawn."""
    marker = Marker(header=header, ns=namespace, type=kind, action=Marker.ADD)
    marker.scale.x, marker.scale.y, marker.scale.z = size
    if colour is not None:
        marker.color = colour
    return marker


def _drawable_positions(prediction: PathPrediction) -> NDArray[np.float64]:
    """Return (n, 3) positions; poses that did not settle get the last known height."""
    positions = np.column_stack([prediction.poses[:, :2], prediction.position[:, 2]])
    known = np.flatnonzero(np.isfinite(positions[:, 2]))
    if len(known) == 0:
        positions[:, 2] = 0.0
        return positions
    latest = np.searchsorted(known, np.arange(len(positions)), side="right") - 1
    positions[:, 2] = positions[known[np.maximum(latest, 0)], 2]
    return positions


def _points(positions) -> list[Point]:
    """Convert positions (m, 3) [m] into messages."""
    return [Point(x=x, y=y, z=z) for x, y, z in np.asarray(positions).tolist()]
