"""The compiled part of the search for the shortest ways."""

import numpy as np

from rover_physics.numerics.kernels import exact_kernel


@exact_kernel
def advance_front(masks, moves, front, distance, onward):
    """Advance a front by one move or turn; return how many nodes are nearer than before.

    A node is a cell at a heading: `cell * headings + heading`, cells row by row.

    Args:
        masks: (ny, nx) uint64 bits of the passable headings, and (ny, nx) uint64 bits of the
            headings at which the rover may turn.
        moves: Moves.
        front: (n,) nodes.
        distance: (ny nx headings,) distance of each node so far [m], infinite if not reached;
            written. One below 0 closes a node.
        onward: (3 n,) nodes that are nearer than before, written.
    """
    passable, turnable = masks
    columns = passable.shape[1]
    headings, found = moves.counts.size, 0
    for at in range(front.size):
        node = front[at]
        cell, heading = node // headings, node % headings
        i, j = cell // columns, cell % columns
        far = distance[node]
        target = _drive(passable, moves, (i, j), heading)
        if target >= 0:
            there = np.float32(far + moves.lengths[heading])
            goal = target * headings + heading
            if there < distance[goal]:
                distance[goal] = there
                onward[found] = goal
                found += 1
        if turnable[i, j] >> np.uint64(heading) & np.uint64(1):
            for side in range(-1, 2, 2):
                other = (heading + side) % headings
                goal = cell * headings + other
                if turnable[i, j] >> np.uint64(other) & np.uint64(1) and far < distance[goal]:
                    distance[goal] = far
                    onward[found] = goal
                    found += 1
    return found


@exact_kernel
def _drive(passable, moves, place, heading):
    """Return the cell at the end of a move, -1 if it is not passable."""
    rows, columns = passable.shape
    count, bit = moves.counts[heading], np.uint64(heading)
    last = count - 1
    i, j = place
    for k in range(count):
        row, column = i + moves.steps[heading, k, 0], j + moves.steps[heading, k, 1]
        if not (0 <= row < rows and 0 <= column < columns):
            return -1
        if not passable[row, column] >> bit & np.uint64(1):
            return -1
    return (i + moves.steps[heading, last, 0]) * columns + j + moves.steps[heading, last, 1]
