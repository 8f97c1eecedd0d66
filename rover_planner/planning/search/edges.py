# SPDX-License-Identifier: Apache-2.0
"""The edges of the lattice: motion primitives of a rover, each of which begins at a node.

A primitive is a straight line, a curve of one arc with a straight line before or behind it, a turn
on the spot, or one of these driven backwards. Curves are no tighter than the rover's smallest
radius. Each begins and ends exactly at a node, so that primitives join without gaps. What the
model found of an edge is kept until the ground under it changes.
"""

from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from rover_physics.rover.model import Rover
from rover_physics.rover.steering_joints import can_turn_on_the_spot, swing_radius, tightest_radius
from rover_planner.angles import wrap
from rover_planner.planning.candidates import turn_on_the_spot
from rover_planner.planning.dubins import count_steps, drive_word
from rover_planner.planning.search.nodes import HEADINGS, STEPS, YAWS, Nodes, opposite

CURVES = {1: 2, 2: 1}
"""Number of curves to either side that turn by so many headings."""
BACKWARD_CURVES = {1: 1}
"""As CURVES, driven backwards."""
_SEARCH_RADIUS = 40
"""Largest distance of a curve's end [cells]."""
UNJUDGED, PASSES, FAILS = 0, 1, 2
"""States of an edge or node; states from FAILS on tell the limit that fails, see
`Edges.codes`."""


class Gear(IntEnum):
    """Gear of a primitive: forward, backward or a turn on the spot."""

    FORWARD = 0
    BACKWARD = 1
    ON_THE_SPOT = 2


PRICES = {Gear.FORWARD: 1.0, Gear.BACKWARD: 1.5, Gear.ON_THE_SPOT: 1.5}
"""Price of time in each gear: sensors look ahead, and turning on the spot wears the wheels."""


@dataclass(frozen=True, eq=False)
class Piece:
    """A piece of path that is driven in one gear."""

    poses: NDArray[np.float64]
    """(n, 3) waypoints in the order of the drive, x, y [m], yaw [rad], map frame."""
    gear: Gear
    """Gear in which it is driven."""
    cost: float = np.nan
    """Its cost [m of level ground], NaN if it is not judged."""
    surcharge: float = 0.0
    """Part of the cost that is not of its drive [m]."""


@dataclass(frozen=True, eq=False)
class Primitive:
    """One piece of path between two nodes."""

    step: tuple[int, int]
    """From its first node to its last one, x and y [cells]."""
    end_heading: int
    """Heading at its end."""
    gear: Gear
    """Gear in which it is driven."""
    length: float
    """Distance driven by the body origin, or by the outermost wheel on the spot [m]."""
    poses: NDArray[np.float64]
    """(n, 3) waypoints from the first node to the last, x, y [m] from the first node, yaw [rad];
    yaw goes on beyond pi. Read-only: all searches share it."""

    def __post_init__(self) -> None:
        self.poses.setflags(write=False)

    @property
    def least_cost(self) -> float:
        """Its cost on level ground [m], a bound from below on any ground."""
        return PRICES[self.gear] * self.length


def make_primitives(
    rover: Rover, cell: float, waypoint_spacing: float
) -> tuple[tuple[Primitive, ...], ...]:
    """Return the primitives of each heading.

    Args:
        rover: The rover; its steering sets the smallest radius, and whether it turns on the spot.
        cell: Distance of neighbouring nodes [m].
        waypoint_spacing: Largest distance between waypoints [m].
    """
    swing = swing_radius(rover) if can_turn_on_the_spot(rover) else None
    return _make_primitives(tightest_radius(rover), swing, cell, waypoint_spacing)


@lru_cache(maxsize=8)
def _make_primitives(
    radius: float, swing: float | None, cell: float, waypoint_spacing: float
) -> tuple[tuple[Primitive, ...], ...]:
    """Return the primitives of a smallest radius [m] and, to turn on the spot, of a swing [m]."""
    return tuple(
        (
            *_forward(heading, cell, radius, waypoint_spacing, CURVES),
            *(
                _reverse(primitive)
                for primitive in _forward(
                    opposite(heading), cell, radius, waypoint_spacing, BACKWARD_CURVES
                )
            ),
            *(() if swing is None else _turns(heading, swing, waypoint_spacing)),
        )
        for heading in range(HEADINGS)
    )


def _forward(
    heading: int, cell: float, radius: float, spacing: float, curves: dict[int, int]
) -> list[Primitive]:
    """Return the straight line and the curves of a heading."""
    found = [_straight(heading, cell, spacing)]
    for turn, count in curves.items():
        for side in (1, -1):
            found += _curves(heading, side * turn, cell, radius, spacing)[:count]
    return found


def _straight(heading: int, cell: float, spacing: float) -> Primitive:
    """Return the straight line to the next node ahead."""
    step = np.array(STEPS[heading])
    length = float(np.hypot(*step)) * cell
    shares = np.linspace(0.0, 1.0, 1 + count_steps(length, spacing))
    poses = np.column_stack([shares[:, None] * step * cell, np.full(len(shares), YAWS[heading])])
    return Primitive(STEPS[heading], heading, Gear.FORWARD, length, poses)


def _curves(
    heading: int, turn: int, cell: float, radius: float, spacing: float
) -> list[Primitive]:
    """Return the curves that turn by some headings, the shortest first."""
    end = (heading + turn) % HEADINGS
    yaws = YAWS[[heading, end]]
    ahead = np.array([np.cos(yaws), np.sin(yaws)])
    angle = float(wrap(YAWS[end] - YAWS[heading]))
    slope = np.tan(0.5 * abs(angle))
    cells = np.arange(-_SEARCH_RADIUS, _SEARCH_RADIUS + 1)
    steps = np.stack(np.meshgrid(cells, cells, indexing="ij"), axis=-1).reshape(-1, 2)
    legs = np.linalg.solve(ahead, cell * steps.T).T  # from either end to where the lines meet
    arc_legs = legs.min(axis=1)
    fits = arc_legs >= radius * slope - 1e-9
    lengths = legs.sum(axis=1) - 2.0 * arc_legs
    lengths += abs(angle) / slope * arc_legs
    rows = np.flatnonzero(fits)
    order = rows[np.lexsort((steps[rows, 1], steps[rows, 0], lengths[rows].round(9)))]
    found: list[Primitive] = []
    for row in order[: max(CURVES.values())]:
        bend = arc_legs[row] / slope
        before, behind = (legs[row] - arc_legs[row]) / bend
        word, start = "SLS" if angle > 0.0 else "SRS", np.array([0.0, 0.0, YAWS[heading]])
        poses = drive_word(start, word, (before, abs(angle), behind), bend, spacing)
        step = (int(steps[row, 0]), int(steps[row, 1]))
        found.append(Primitive(step, end, Gear.FORWARD, float(lengths[row]), poses))
    return found


def _reverse(forward: Primitive) -> Primitive:
    """Return a primitive of the opposite heading as it is driven backwards."""
    poses = forward.poses - (0.0, 0.0, np.pi)
    return Primitive(
        forward.step, opposite(forward.end_heading), Gear.BACKWARD, forward.length, poses
    )


def _turns(heading: int, swing: float, spacing: float) -> list[Primitive]:
    """Return the turns on the spot to the neighbouring headings."""
    found = []
    for side in (1, -1):
        end = (heading + side) % HEADINGS
        angle = float(wrap(YAWS[end] - YAWS[heading]))
        poses = turn_on_the_spot(np.zeros(2), YAWS[heading], angle, spacing / swing)
        found.append(Primitive((0, 0), end, Gear.ON_THE_SPOT, swing * abs(angle), poses))
    return found


@dataclass(eq=False)
class Edges:
    """The edges of the nodes of a window, with what the model found of them.

    Edge `node * P + k` is primitive k of the node; P is the largest number of primitives.
    """

    nodes: Nodes
    """The nodes."""
    primitives: tuple[tuple[Primitive, ...], ...]
    """The primitives of each heading."""

    def __post_init__(self) -> None:
        self.width = max(len(own) for own in self.primitives)
        """Largest number of primitives of a heading, P."""
        self.least_cost = np.full((HEADINGS, self.width), np.inf)
        """(HEADINGS, P) cost of the primitives on level ground [m]."""
        for costs, own in zip(self.least_cost, self.primitives, strict=True):
            costs[: len(own)] = [one.least_cost for one in own]
        shape = (self.nodes.count, self.width)
        self.state = np.zeros(shape, np.int8)
        """(nodes, P) UNJUDGED, PASSES, or FAILS + i for the failure `codes[i]`."""
        self.cost = np.zeros(shape, np.float32)
        """(nodes, P) cost [m] where the edge passes."""
        self.standing = np.zeros(self.nodes.count, np.int8)
        """(nodes,) as `state`: whether the rover can stand at a node with its wheels ahead."""
        self.codes: list[str] = []
        """Codes of the limits that failed so far."""

    @cached_property
    def links(self) -> NDArray[np.int64]:
        """Primitives that begin, and those that end with a heading, (2, HEADINGS, L, 4).

        Of each the heading at the other end, the number among those of its first heading, and the
        step in x and y to the other end [cells]. -1 ends a list.
        """
        lists: list[list[tuple[int, ...]]] = [[] for _ in range(2 * HEADINGS)]
        for heading, own in enumerate(self.primitives):
            for k, primitive in enumerate(own):
                (x, y), end = primitive.step, primitive.end_heading
                lists[heading].append((end, k, x, y))
                lists[HEADINGS + end].append((heading, k, -x, -y))
        links = np.full((2 * HEADINGS, max(map(len, lists)), 4), -1)
        for row, found in zip(links, lists, strict=True):
            row[: len(found)] = found
        return links.reshape(2, HEADINGS, -1, 4)

    @property
    def count(self) -> int:
        """Number of edges, those counted that leave the window."""
        return self.nodes.count * self.width

    def piece(self, edge: int) -> Piece:
        """Return an edge as a piece of path, with its cost if it was judged.

        It begins and ends exactly at its nodes, so that a path has the poses of its pieces.
        """
        node, k = divmod(int(edge), self.width)
        primitive = self.primitives[node % HEADINGS][k]
        ends = self.nodes.poses(np.append(node, self.ends(np.array([edge]))))
        poses = primitive.poses + np.array([*ends[0, :2], 0.0])
        poses[:, 2] = wrap(poses[:, 2])
        poses[[0, -1]] = ends
        return Piece(poses, primitive.gear, float(self.cost.flat[edge]))

    def is_open(self, edge: int) -> bool:
        """Return whether an edge is not judged."""
        return bool(self.state.flat[edge] == UNJUDGED)

    def ends(self, edges: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the nodes (n,) where edges (n,) end; they must be in the window."""
        node, k = np.divmod(edges, self.width)
        place, heading = np.divmod(node, HEADINGS)
        end_heading, _, x, y = self.links[0, heading, k].T
        return (place + y * self.nodes.shape[1] + x) * HEADINGS + end_heading

    def write(self, edge: int, code: str, cost: float) -> None:
        """Keep what was found of an edge: the code of its failure, "" for none, and its cost."""
        self.state.flat[edge], self.cost.flat[edge] = self.state_of(code), cost

    def state_of(self, code: str) -> int:
        """Return the state of what fails by a code, or passes if it is empty."""
        if code and code not in self.codes:
            self.codes.append(code)
        return FAILS + self.codes.index(code) if code else PASSES

    def forget(self, places: NDArray[np.int64]) -> None:
        """Forget what is known of the nodes at places (k,) and of the edges that begin there."""
        for values in (self.state, self.standing):
            values.reshape(-1, HEADINGS, *values.shape[1:])[places] = UNJUDGED
