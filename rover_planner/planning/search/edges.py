# SPDX-License-Identifier: Apache-2.0
"""The edges of the lattice: each is a primitive that begins at a node.

What the model found of an edge is kept until the ground under it changes.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rover_planner.angles import wrap
from rover_planner.planning.search.nodes import HEADINGS, Nodes
from rover_planner.planning.search.primitives import Piece, Primitive

UNJUDGED, PASSES, FAILS = 0, 1, 2
"""States of an edge or node; states from FAILS on tell the limit that fails, see
`Edges.codes`."""


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
