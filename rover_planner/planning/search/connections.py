# SPDX-License-Identifier: Apache-2.0
"""Connections of the start and the goal, which lie anywhere, to nodes of the lattice."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from rover_physics.numerics.arrays import Floats
from rover_physics.rover.model import Rover
from rover_physics.rover.steering_joints import can_turn_on_the_spot, swing_radius, tightest_radius
from rover_planner.angles import wrap
from rover_planner.planning.candidates import turn_and_drive
from rover_planner.planning.dubins import dubins_lengths, shortest_dubins_path
from rover_planner.planning.path_query import Pose
from rover_planner.planning.search.edges import PRICES, Gear, Piece
from rover_planner.planning.search.judge import PathJudge
from rover_planner.planning.search.nodes import HEADINGS, Nodes, nearest_heading

MAX_DISTANCE = 3.0
"""Distance within which nodes are looked for, unless the rover turns too widely for it [cells]."""
MOST_CURVES = 16
"""Largest number of curves in each gear."""
TURNED_PLACES = 4
"""Number of nearest places to which the rover turns on the spot and drives straight."""
LARGEST_TURN = 3
"""Largest turn of a curve [headings]."""
DETOUR = 1.3
"""Largest length of a curve over the distance of its ends."""

MISSED_PRICE = 10.0
"""Cost of each metre that is left from the end of a path to the goal [m of level ground]."""

FRONTIER_PLACES = 48
"""Number of places at the frontier that are offered to the search."""
FRONTIER_BATCH = 1000
"""Number of poses at the frontier that the model is asked about at once."""


@dataclass(frozen=True, eq=False)
class Connection:
    """A piece of path between the start or the goal and a node.

    At the frontier of the known ground it is a single pose.
    """

    node: int
    """The node."""
    gear: Gear
    """Gear in which it is driven."""
    cost: float
    """Its cost on level ground [m]."""
    make: Callable[[], Floats]
    """Makes its waypoints (n, 3)."""
    surcharge: float = 0.0
    """Cost that comes to that of driving [m]."""

    def piece(self, cost: float) -> Piece:
        """Return it as a piece of path with its cost [m]."""
        return Piece(self._poses, self.gear, cost, self.surcharge)

    @cached_property
    def _poses(self) -> Floats:
        return self.make()


def connect_end(
    rover: Rover, nodes: Nodes, end: Pose, waypoint_spacing: float, *, is_goal: bool
) -> list[Connection]:
    """Return connections of the start or the goal, a pose (3,), with nodes.

    Waypoints are at most `waypoint_spacing` [m] apart.
    """
    connector = _Connector(rover, nodes, end, waypoint_spacing, is_goal)
    curves = [connector.curves(gear) for gear in (Gear.FORWARD, Gear.BACKWARD)]
    return [*curves[0], *curves[1], *connector.turns()]


@dataclass(frozen=True, eq=False)
class _Connector:
    """Connects one end of a path with nodes."""

    rover: Rover
    nodes: Nodes
    end: Pose
    waypoint_spacing: float
    is_goal: bool

    def curves(self, gear: Gear) -> list[Connection]:
        """Return the shortest curves between the end and the nodes ahead or behind.

        Those of the backward gear are driven as if forwards, with all headings turned round.
        """
        is_behind = self.is_goal != (gear == Gear.BACKWARD)
        radius, cell = tightest_radius(self.rover), self.nodes.cell
        # An S to a line half a cell aside, and an arc by half the angle between headings.
        bend = math.sqrt(2.0 * radius * cell) + radius * math.pi / HEADINGS
        reach = max(MAX_DISTANCE * cell, bend)
        nodes, there = _nodes_beside(self.nodes, self.end, reach, -1.0 if is_behind else 1.0)
        lengths = dubins_lengths(*self._order(there, gear), radius)
        fits = lengths <= DETOUR * np.hypot(*(there - self.end)[:, :2].T) + 1e-9
        nodes, there, costs = nodes[fits], there[fits], PRICES[gear] * lengths[fits]
        return [
            Connection(int(nodes[k]), gear, float(costs[k]), partial(self._drive, there[k], gear))
            for k in np.lexsort((nodes, costs))[:MOST_CURVES].tolist()
        ]

    def _order(self, there: Floats, gear: Gear) -> tuple[Floats, Floats]:
        """Return first and last pose of the drive between the end and a node, or nodes (n, 3)."""
        end = self.end
        if gear == Gear.BACKWARD:
            end, there = _about(end), _about(there)
        return (there, end) if self.is_goal else (end, there)

    def _drive(self, there: Pose, gear: Gear) -> Floats:
        """Return the waypoints (n, 3) of the shortest Dubins path between the end and a node."""
        first, last = self._order(there, gear)
        radius = tightest_radius(self.rover)
        poses = shortest_dubins_path(first, last, radius, self.waypoint_spacing)
        return poses - (0.0, 0.0, np.pi if gear == Gear.BACKWARD else 0.0)

    def turns(self) -> list[Connection]:
        """Return paths that turn, drive straight and turn, if the rover turns on the spot.

        They lead to the nearest nodes that head away from a start, or towards a goal.
        """
        if not can_turn_on_the_spot(self.rover):
            return []
        nodes, end, gear = self.nodes, self.end, Gear.ON_THE_SPOT
        places = nodes.places_near(end, MAX_DISTANCE * nodes.cell)
        aways = nodes.cell * (places + nodes.first) - end[:2]
        distances = np.hypot(*aways.T)
        swing, found = swing_radius(self.rover), []
        for row in np.argsort(distances, kind="stable")[:TURNED_PLACES]:
            x, y = -aways[row] if self.is_goal else aways[row]
            heading = nearest_heading(np.arctan2(y, x) if distances[row] > 1e-6 else end[2])
            node = nodes.index(places[row : row + 1], np.array([heading]))
            ends = self._order(nodes.poses(node)[0], gear)
            poses, length = turn_and_drive(*ends, swing, self.waypoint_spacing)
            make = partial(np.asarray, poses)
            found.append(Connection(int(node[0]), gear, PRICES[gear] * length, make))
        return found


def _nodes_beside(
    nodes: Nodes, pose: Pose, reach: float, side: float
) -> tuple[NDArray[np.int64], Floats]:
    """Return the nodes (n,) within `reach` [m] ahead of a pose (side 1) or behind it (-1).

    They are hardly turned; their poses (n, 3) are the second.
    """
    ahead = side * np.array([np.cos(pose[2]), np.sin(pose[2])])
    places = nodes.places_near(pose, reach)
    away = nodes.cell * (places + nodes.first) - pose[:2]
    distance = np.hypot(*away.T)
    places = places[(distance >= 1e-6) & (away @ ahead >= 0.5 * distance)]
    turns = nearest_heading(pose[2]) + np.arange(-LARGEST_TURN, LARGEST_TURN + 1)
    headings = np.tile(turns % HEADINGS, len(places))
    found = nodes.index(np.repeat(places, len(turns), axis=0), headings)
    return found, nodes.poses(found)


def _about(pose: Floats) -> Floats:
    """Return the pose (3,), or poses (n, 3), that heads the other way."""
    return np.concatenate([pose[..., :2], wrap(pose[..., 2:] + np.pi)], axis=-1)


def connect_frontier(
    judge: PathJudge, nodes: Nodes, known: NDArray[np.int64], start: Pose, goal: Pose
) -> list[Connection]:
    """Return the nodes nearest to a goal on which the rover can stand, as ends of a path.

    They lie at least a quarter of the wheelbase apart. What is left to the goal has a price.

    Args:
        judge: The model.
        nodes: All nodes.
        known: Those (n,) that may be on known ground; the model is asked about no others.
        start: Start of the path.
        goal: The goal.
    """
    away = np.hypot(*(nodes.poses(known)[:, :2] - goal[:2]).T)
    by_distance = known[np.argsort(away, kind="stable")]
    found: list[Connection] = []
    chosen: list[np.ndarray] = []
    apart = 0.25 * judge.site.rover.wheelbase
    for first in range(0, len(by_distance), FRONTIER_BATCH):
        asked = by_distance[first : first + FRONTIER_BATCH]
        poses = nodes.poses(asked)
        stands = np.array([code == "" for code in judge.stand(poses)])
        stands &= ~judge.site.marked.refuses_ends(start, poses)
        for node, pose in zip(asked[stands], poses[stands], strict=True):
            near = min((np.hypot(*(pose - other)[:2]) for other in chosen), default=np.inf)
            if 1e-9 < near < apart:
                continue
            if near > 1e-9:
                if len(chosen) == FRONTIER_PLACES:
                    return found
                chosen.append(pose)
            price = MISSED_PRICE * float(np.hypot(*(pose - goal)[:2]))
            make = partial(np.asarray, pose[None, :])
            found.append(Connection(int(node), Gear.FORWARD, 0.0, make, price))
    return found
