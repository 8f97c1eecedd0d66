# SPDX-License-Identifier: Apache-2.0
"""Dubins paths: forward connections of two poses by arcs of one radius and straight lines.

Dubins, L. E. (1957), On curves of minimal length with a constraint on average curvature, American
Journal of Mathematics 79(3). The six words are solved in the normalised form of Shkel and Lumelsky
(2001), Classification of the Dubins set, Robotics and Autonomous Systems 34.
"""

import math

import numpy as np

_TURN = {"L": 1.0, "S": 0.0, "R": -1.0}
"""Curvature of each letter of a word, in 1 / radius, positive to the left."""
_WORDS = ("LSL", "RSR", "LSR", "RSL", "RLR", "LRL")
"""All words; of two of the same length the first is preferred."""


def dubins_paths(
    start: np.ndarray,
    goal: np.ndarray,
    radius: float,
    waypoint_spacing: float,
    most: int | None = None,
) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Return the Dubins paths between two poses, the shortest first.

    Args:
        start: (3,) x, y [m] and yaw [rad].
        goal: (3,) x, y [m] and yaw [rad].
        radius: Radius of the arcs [m].
        waypoint_spacing: Largest distance between waypoints along the path [m].
        most: Largest number of paths; None returns all.

    Returns:
        One to six paths, each x (n,), y (n,) [m] and yaw (n,) [rad], with equidistant
        waypoints.
    """
    words = _words_between(start, goal, radius)
    words.sort(key=lambda word: sum(word[1]))
    return [_drive(start, word, pieces, radius, waypoint_spacing) for word, pieces in words[:most]]


def dubins_length(start: np.ndarray, goal: np.ndarray, radius: float) -> float:
    """Return the length [m] of the shortest Dubins path; arguments as for `dubins_paths`."""
    return radius * min(sum(pieces) for _, pieces in _words_between(start, goal, radius))


def _words_between(
    start: np.ndarray, goal: np.ndarray, radius: float
) -> list[tuple[str, tuple[float, float, float]]]:
    """Return the words between two poses; pieces as `_solve_words` returns them."""
    dx, dy = ((goal[:2] - start[:2]) / radius).tolist()
    bearing, distance = math.atan2(dy, dx), math.hypot(dx, dy)
    return _solve_words(
        _turn(float(start[2]) - bearing), _turn(float(goal[2]) - bearing), distance
    )


def _solve_words(a: float, b: float, d: float) -> list[tuple[str, tuple[float, float, float]]]:
    """Solve the six words for headings a, b relative to the chord [rad] and its length d [radii].

    Return each word that exists, with the lengths of its three pieces [radii; rad on arcs].
    """
    found = _solve_left(a, b, d, "LSL", "LSR", "LRL") | _solve_left(-a, -b, d, "RSR", "RSL", "RLR")
    return [(word, found[word]) for word in _WORDS if word in found]


def _solve_left(
    a: float, b: float, d: float, same: str, crossed: str, curved: str
) -> dict[str, tuple[float, float, float]]:
    """Solve the words that begin to the left; with mirrored headings those to the right."""
    sa, ca, sb, cb, cab = math.sin(a), math.cos(a), math.sin(b), math.cos(b), math.cos(a - b)
    found = {}
    square = 2 + d * d - 2 * cab + 2 * d * (sa - sb)
    if square >= 0:
        line = math.atan2(cb - ca, d + sa - sb)
        found[same] = _turn(line - a), math.sqrt(square), _turn(b - line)
    square = -2 + d * d + 2 * cab + 2 * d * (sa + sb)
    if square >= 0:
        p = math.sqrt(square)
        line = math.atan2(-ca - cb, d + sa + sb) - math.atan2(-2.0, p)
        found[crossed] = _turn(line - a), p, _turn(line - b)
    cosine = (6 - d * d + 2 * cab + 2 * d * (sb - sa)) / 8
    if abs(cosine) <= 1:
        p = 2 * math.pi - math.acos(cosine)
        t = _turn(-a - math.atan2(ca - cb, d + sa - sb) + p / 2)
        found[curved] = t, p, _turn(b - a - t + p)
    return found


def _drive(start, word, pieces, radius, waypoint_spacing):
    """Sample a word from the start; return equidistant x, y, yaw (n,)."""
    ends = np.concatenate([[0.0], np.cumsum(pieces)])
    steps = max(1, int(np.ceil(ends[-1] * radius / waypoint_spacing - 1e-9)))
    driven = np.linspace(0.0, ends[-1], steps + 1)
    x, y, yaw = np.zeros(steps + 1), np.zeros(steps + 1), np.zeros(steps + 1)
    x0, y0, yaw0 = 0.0, 0.0, start[2]
    for k, letter in enumerate(word):
        here = (driven >= ends[k]) if k == 2 else (driven >= ends[k]) & (driven < ends[k + 1])
        x[here], y[here], yaw[here] = _advance(x0, y0, yaw0, _TURN[letter], driven[here] - ends[k])
        x0, y0, yaw0 = _advance(x0, y0, yaw0, _TURN[letter], pieces[k])
    return start[0] + radius * x, start[1] + radius * y, yaw


def _advance(x, y, yaw, turn, s):
    """Return the pose after s [radii] along a left (turn 1) or right (-1) arc or a line (0)."""
    if turn == 0.0:
        return x + s * np.cos(yaw), y + s * np.sin(yaw), yaw + 0.0 * s
    after = yaw + turn * s
    return (
        x + turn * (np.sin(after) - np.sin(yaw)),
        y - turn * (np.cos(after) - np.cos(yaw)),
        after,
    )


def _turn(angle: float) -> float:
    """Wrap an angle [rad] into 0 to 2 pi; a full turn within rounding errors becomes 0."""
    turned = angle % (2.0 * math.pi)
    return 0.0 if 2.0 * math.pi - turned < 1e-9 else turned
