# SPDX-License-Identifier: Apache-2.0
"""Outlines of the links of a rover in a state: wheels, body, rockers and bogies."""

import numpy as np

from rover_physics.names import SIDES, WHEELS
from rover_physics.numerics.arrays import Floats
from rover_physics.numerics.quaternions import matrix_from_xyzw, xyzw_from_rpy
from rover_physics.rover.model import Rover
from rover_planner.viewer.scene.rover_visual import on_side
from rover_planner.viewer.state.failure import BODY
from rover_planner.viewer.state.trajectory import RoverState, find_axles

CORNERS = 32
"""Corners of the ring around a wheel."""
WIDER = 1.12
"""Radius of the ring around a wheel [wheel radii]."""
EDGES = ((0, 1), (1, 3), (3, 2), (2, 0), (4, 5), (5, 7), (7, 6), (6, 4), (0, 4), (1, 5), (2, 6),
         (3, 7))  # fmt: skip
"""Edges of a box between its corners, which count in binary: z, y, x."""


def outline_link(rover: Rover, state: RoverState, link: str) -> Floats:
    """Return line segments (n, 2, 3) [m] around a link, map frame; none for an empty name.

    Args:
        rover: The rover.
        state: Where it is.
        link: A name of WHEELS, BODY, or rocker or bogie with its side, such as bogie_left.
    """
    if link in WHEELS:
        return _outline_wheel(rover, state, WHEELS.index(link))
    if link == BODY:
        return _outline_body(rover, state)
    name, _, side = link.partition("_")
    if side not in SIDES:
        return np.empty((0, 2, 3))
    return _outline_beams(rover, state, name, side)


def centre_of(segments: Floats, state: RoverState) -> Floats:
    """Return the middle (3,) of segments; that of the body if there are none."""
    return segments.reshape(-1, 3).mean(axis=0) if len(segments) else state.position


def _outline_wheel(rover: Rover, state: RoverState, wheel: int) -> Floats:
    """Return a ring around each face of a wheel, and bars between them."""
    axle = find_axles(rover, state)[wheel]
    across = np.cross(axle, [0.0, 0.0, 1.0])
    across /= np.linalg.norm(across)
    up = np.cross(across, axle)
    turn = np.linspace(0.0, 2.0 * np.pi, CORNERS + 1)[:, None]
    ring = WIDER * rover.wheel.radius * (np.cos(turn) * across + np.sin(turn) * up)
    rings = [
        state.wheel_centres[wheel] + ring + side * 0.5 * rover.wheel.width * axle
        for side in (-1.0, 1.0)
    ]
    around = [np.stack([points[:-1], points[1:]], axis=1) for points in rings]
    bars = np.stack(rings, axis=1)[: -1 : CORNERS // 4]
    return np.concatenate([*around, bars])


def _outline_body(rover: Rover, state: RoverState) -> Floats:
    """Return the edges of the box that is drawn as the body."""
    belly = rover.belly
    heights = (belly.z, belly.z + 1.4 * rover.wheel.radius)
    corners = np.array([[x, y, z] for x in belly.x for y in belly.y for z in heights])
    placed = state.position + corners @ _attitude(state).T
    return placed[np.array(EDGES)]


def _outline_beams(rover: Rover, state: RoverState, name: str, side: str) -> Floats:
    """Return lines along the beams of a rocker or a bogie."""
    suspension, R = rover.suspension, _attitude(state)
    k = SIDES.index(side)
    rocker = on_side(suspension.rocker_pivot, side)
    bogie = on_side(suspension.bogie_pivot, side)
    s, c = np.sin(state.rocker_angle[k]), np.cos(state.rocker_angle[k])
    turn = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    rocker_place = state.position + R @ rocker
    bogie_place = rocker_place + R @ turn @ (bogie - rocker)
    ends = {f"{wheel}_{side}" for wheel in suspension.bogie_wheels}
    centres = {wheel: state.wheel_centres[i] for i, wheel in enumerate(WHEELS)}
    if name == "bogie":
        return np.array([[bogie_place, centres[wheel]] for wheel in sorted(ends)])
    rear = centres[f"{suspension.rocker_wheel}_{side}"]
    return np.array([[rocker_place, bogie_place], [rocker_place, rear]])


def _attitude(state: RoverState) -> Floats:
    return matrix_from_xyzw(xyzw_from_rpy(*state.attitude))
