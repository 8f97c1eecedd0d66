# SPDX-License-Identifier: Apache-2.0
"""Dubins paths: forward connections of two poses by arcs of one radius and straight lines.

Dubins, L. E. (1957), On curves of minimal length with a constraint on average curvature, American
Journal of Mathematics 79(3). The six words are solved in the normalised form of Shkel and Lumelsky
(2001), Classification of the Dubins set, Robotics and Autonomous Systems 34.
"""

import numpy as np
from numpy.typing import NDArray

Angles = NDArray[np.float64]
"""Angles or lengths (n,), or a single one."""

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
) -> list[np.ndarray]:
    """Return the Dubins paths between two poses, the shortest first.

    Args:
        start: (3,) x, y [m] and yaw [rad].
        goal: (3,) x, y [m] and yaw [rad].
        radius: Radius of the arcs [m].
        waypoint_spacing: Largest distance between waypoints along the path [m].
        most: Largest number of paths; None returns all.

    Returns:
        One to six paths (n, 3) of x, y [m] and yaw [rad], with equidistant waypoints.
    """
    words = _words_between(start, goal, radius)
    lengths = words.sum(axis=1)
    shortest = np.argsort(lengths, kind="stable")[: np.isfinite(lengths).sum()]
    return [
        drive_word(start, _WORDS[k], words[k], radius, waypoint_spacing) for k in shortest[:most]
    ]


def shortest_dubins_path(start, goal, radius, waypoint_spacing) -> np.ndarray:
    """Return the shortest one of `dubins_paths`; its ends are exact but for the last heading."""
    poses = dubins_paths(start, goal, radius, waypoint_spacing, 1)[0]
    poses[0], poses[-1, :2] = start, goal[:2]
    return poses


def dubins_lengths(
    starts: NDArray[np.float64], goals: NDArray[np.float64], radius: float
) -> NDArray[np.float64]:
    """Return the lengths (n,) [m] of the shortest Dubins paths between poses, (n, 3) or (3,).

    `radius` is as for `dubins_paths`.
    """
    lengths: NDArray[np.float64] = radius * _words_between(starts, goals, radius).sum(axis=1).min(
        0
    )
    return lengths


def _words_between(
    starts: NDArray[np.float64], goals: NDArray[np.float64], radius: float
) -> NDArray[np.float64]:
    """Return the lengths (6, 3, n) of the three pieces of all words [radii; rad on arcs].

    They are infinite where there is no such word; without n for single poses (3,).
    """
    away = (goals - starts)[..., :2] / radius
    bearing, distance = np.arctan2(away[..., 1], away[..., 0]), np.hypot(*away.T)
    a, b = _turn(starts[..., 2] - bearing), _turn(goals[..., 2] - bearing)
    with np.errstate(invalid="ignore"):
        left, right = _solve_left(a, b, distance), _solve_left(-a, -b, distance)
    words = np.array([left[0], right[0], left[1], right[1], right[2], left[2]])
    return np.where(np.isnan(words), np.inf, words)


def _solve_left(a: Angles, b: Angles, d: Angles) -> list[list[Angles]]:
    """Return the pieces of the words LSL, LSR and LRL, NaN where there is none.

    With mirrored headings they are those of RSR, RSL and RLR.

    Args:
        a: Heading at the start, relative to the chord [rad].
        b: Heading at the goal.
        d: Length of the chord [radii].
    """
    sa, ca, sb, cb, cab = np.sin(a), np.cos(a), np.sin(b), np.cos(b), np.cos(a - b)
    line = np.arctan2(cb - ca, d + sa - sb)
    p = np.sqrt(2.0 + d * d - 2.0 * cab + 2.0 * d * (sa - sb))
    same = [_turn(line - a), p, _turn(b - line)]
    p = np.sqrt(-2.0 + d * d + 2.0 * cab + 2.0 * d * (sa + sb))
    line = np.arctan2(-ca - cb, d + sa + sb) - np.arctan2(-2.0, p)
    crossed = [_turn(line - a), p, _turn(line - b)]
    p = 2.0 * np.pi - np.arccos((6.0 - d * d + 2.0 * cab + 2.0 * d * (sb - sa)) / 8.0)
    t = _turn(-a - np.arctan2(ca - cb, d + sa - sb) + p / 2.0)
    return [same, crossed, [t, p, _turn(b - a - t + p)]]


def drive_word(start, word, pieces, radius, waypoint_spacing):
    """Sample a word of three pieces [radii] from the start; return equidistant poses (n, 3)."""
    ends = np.concatenate([[0.0], np.cumsum(pieces)])
    steps = count_steps(ends[-1] * radius, waypoint_spacing)
    driven = np.linspace(0.0, ends[-1], steps + 1)
    x, y, yaw = 0.0, 0.0, start[2]
    for letter, begin, piece in zip(word, ends[:-1], pieces, strict=True):
        along = np.clip(driven - begin, 0.0, piece)
        half = 0.5 * _TURN[letter] * along
        chord = along * np.sinc(half / np.pi)
        x, y = x + chord * np.cos(yaw + half), y + chord * np.sin(yaw + half)
        yaw = yaw + 2.0 * half
    return np.column_stack([start[0] + radius * x, start[1] + radius * y, yaw])


def count_steps(length: float, spacing: float) -> int:
    """Return into how many steps of at most `spacing` a length is divided, both in m or rad."""
    return max(1, int(np.ceil(length / spacing - 1e-9)))


def _turn(angle: Angles) -> Angles:
    """Wrap angles [rad] into 0 to 2 pi; a full turn within rounding errors becomes 0."""
    turned = angle % (2.0 * np.pi)
    return np.where(2.0 * np.pi - turned < 1e-9, 0.0, turned)
