# SPDX-License-Identifier: Apache-2.0
"""Compiled loops over the poses of a tile."""

import numpy as np

from rover_physics.numerics.kernels import exact_kernel
from rover_physics.terrain.ground import elevation_of, find_block_max


@exact_kernel
def mark_unknown_below(grounds, poses, outline, unknown):
    """Write into unknown (n,) whether the outline touches an unknown cell at poses (n, 3).

    A cell touches the outline if its centre is no farther from it than its corners are.

    Args:
        grounds: (1,) GROUND.
        poses: (n, 3) x, y [m] and yaw [rad].
        outline: Rear, front, right and left edge [m], body frame; seen from above.
        unknown: (n,) written.
    """
    ground = grounds[0]
    cell = 1.0 / ground.inverse_resolution
    near = 0.5 * np.sqrt(2.0) * cell
    rear, front, right, left = outline
    rear, front, right, left = rear - near, front + near, right - near, left + near
    farthest = np.hypot(max(-rear, front), max(-right, left))
    for row in range(poses.shape[0]):
        x, y, yaw = poses[row, 0], poses[row, 1], poses[row, 2]
        unknown[row] = False
        gx, gy = (x - ground.x0) / cell, (y - ground.y0) / cell
        if find_block_max(ground, gx, gy, farthest / cell, farthest / cell) < np.inf:
            continue
        c, s = np.cos(yaw), np.sin(yaw)
        low_i = max(int(np.floor((y - farthest - ground.y0) / cell)), 0)
        high_i = min(int(np.ceil((y + farthest - ground.y0) / cell)), ground.rows - 1)
        low_j = max(int(np.floor((x - farthest - ground.x0) / cell)), 0)
        high_j = min(int(np.ceil((x + farthest - ground.x0) / cell)), ground.columns - 1)
        for i in range(low_i, high_i + 1):
            for j in range(low_j, high_j + 1):
                height = elevation_of(ground, i, j)
                if height != height:
                    dx, dy = ground.x0 + j * cell - x, ground.y0 + i * cell - y
                    along, across = c * dx + s * dy, c * dy - s * dx
                    if rear <= along <= front and right <= across <= left:
                        unknown[row] = True
                        break
            if unknown[row]:
                break
