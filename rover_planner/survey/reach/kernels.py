# SPDX-License-Identifier: Apache-2.0
"""The compiled step of the search over cells and headings."""

import numpy as np

from rover_physics.numerics.kernels import exact_kernel


@exact_kernel
def advance_front(distance, turnable, moves, front, onward):
    """Advance a front by one move or turn; return how many nodes are nearer than before.

    A node is a cell at a heading: `cell * headings + heading`, cells row by row.

    Args:
        distance: (ny, nx, headings) distance of each node so far [m], infinite if not reached,
            below 0 if the heading is not passable; written.
        turnable: (ny, nx) bits of the headings at which the rover may turn.
        moves: Moves.
        front: (n,) nodes.
        onward: (3 n,) nodes that are nearer than before, written.
    """
    rows, columns, headings = distance.shape
    found = 0
    for node in front:
        cell, heading = node // headings, node % headings
        i, j = cell // columns, cell % columns
        far = distance[i, j, heading]
        count = moves.counts[heading]
        row, column = i, j
        is_free = True
        for k in range(count):
            row, column = i + moves.steps[heading, k, 0], j + moves.steps[heading, k, 1]
            is_free = 0 <= row < rows and 0 <= column < columns
            is_free = is_free and distance[row, column, heading] >= 0.0
            if not is_free:
                break
        if is_free:
            there = np.float32(far + moves.lengths[heading])
            if there < distance[row, column, heading]:
                distance[row, column, heading] = there
                onward[found] = (row * columns + column) * headings + heading
                found += 1
        if turnable[i, j] >> np.uint64(heading) & np.uint64(1):
            for side in range(-1, 2, 2):
                other = (heading + side) % headings
                may_turn = turnable[i, j] >> np.uint64(other) & np.uint64(1)
                if may_turn and far < distance[i, j, other]:
                    distance[i, j, other] = far
                    onward[found] = cell * headings + other
                    found += 1
    return found
