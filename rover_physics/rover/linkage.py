# SPDX-License-Identifier: Apache-2.0
"""Rocker-bogie linkage for kernels: its constants, and the positions of its parts."""

from typing import Any

import numpy as np

from rover_physics.names import WHEEL_POSITIONS
from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.records import new_record, record_type
from rover_physics.rover.manipulator import body_mass_and_com
from rover_physics.rover.model import Rover
from rover_physics.rover.steering_joints import steered_wheels, swing_radius

LINKAGE = record_type(
    ("radius", float),  # wheel radius [m]
    ("width", float),  # wheel width [m]
    ("wheels", float, (6, 3)),  # wheel centres [m] in wheel order
    ("on_bogie", np.uint8, (6,)),  # 1 for the wheels that hang on a bogie
    ("steers", np.uint8, (6,)),  # 1 for the wheels that steer
    ("steering_limit", float),  # largest steering angle [rad], 0 if all wheels are fixed
    ("steering_rate", float),  # largest speed of the steering [rad/s]
    ("swing_radius", float),  # distance of the outermost wheel from the origin, from above [m]
    ("rocker_pivots", float, (2, 3)),  # rocker pivots [m]
    ("bogie_pivots", float, (2, 3)),  # bogie pivots [m]
    ("gravity", float),  # gravity [m/s^2]
    ("wheel_mass", float),  # mass of one wheel [kg]
    ("body_mass", float),  # mass of the body with its arm and payload [kg]
    ("body_com", float, (3,)),  # centre of mass of the body with its arm and payload [m]
    ("rocker_mass", float),  # mass of one rocker [kg]
    ("rocker_coms", float, (2, 3)),  # centres of mass of the rockers [m]
    ("bogie_mass", float),  # mass of one bogie [kg]
    ("bogie_coms", float, (2, 3)),  # centres of mass of the bogies [m]
    ("mass", float),  # mass of the whole rover [kg]
    ("length", float),  # rear to front axle [m], the reference length of moments
    ("belly", float, (5,)),  # underside: z, smallest and largest x, smallest and largest y [m]
    ("has_tool_load", np.bool_),  # whether a force or moment acts on the arm's tool
    ("tool", float, (3, 3)),  # tip of the arm [m], force [N] and moment [N m] on the tool
)
"""Geometry and masses of a rover, body frame, flat ground, right side first."""

NO_TOOL = np.zeros((3, 3))
"""Tool without force and moment."""


def pack_linkage(
    rover: Rover,
    body_mass: float | None = None,
    body_com: np.ndarray | None = None,
    tool: np.ndarray = NO_TOOL,
) -> Any:
    """Return the constants of a rover as a LINKAGE.

    Args:
        rover: The rover.
        body_mass: Mass of the body with its arm and payload [kg] (default: that of the rover file,
            arm stowed).
        body_com: (3,) centre of mass of body, arm and payload [m], body frame (default: the same).
        tool: (3, 3) tip of the arm [m], force [N] and moment [N m] on the tool, body frame.
    """
    suspension, masses, belly = rover.suspension, rover.masses, rover.belly
    wheel, steering = rover.wheel, rover.steering
    if body_mass is None or body_com is None:
        body_mass, body_com = body_mass_and_com(rover)
    left = [suspension.wheels[name] for name in WHEEL_POSITIONS]
    on_bogie = [name != suspension.rocker_wheel for name in WHEEL_POSITIONS]
    return new_record(
        LINKAGE,
        radius=wheel.radius,
        width=wheel.width,
        wheels=np.array([_mirror(p) for p in left] + left, dtype=float),
        on_bogie=np.array(on_bogie * 2),
        steers=np.isin(np.arange(6), steered_wheels(rover)),
        steering_limit=0.0 if steering is None else float(steering.limit),
        steering_rate=np.inf if steering is None else float(steering.rate),
        swing_radius=swing_radius(rover),
        rocker_pivots=_both_sides(suspension.rocker_pivot),
        bogie_pivots=_both_sides(suspension.bogie_pivot),
        gravity=rover.gravity,
        wheel_mass=wheel.mass,
        body_mass=body_mass,
        body_com=np.asarray(body_com, dtype=float),
        rocker_mass=masses.rocker.mass,
        rocker_coms=_both_sides(masses.rocker.com),
        bogie_mass=masses.bogie.mass,
        bogie_coms=_both_sides(masses.bogie.com),
        mass=body_mass + 2 * (masses.rocker.mass + masses.bogie.mass) + 6 * wheel.mass,
        length=rover.wheelbase,
        belly=np.array([belly.z, *belly.x, *belly.y], dtype=float),
        has_tool_load=bool(np.any(tool[1:])),
        tool=np.ascontiguousarray(tool, dtype=float),
    )


def _mirror(point) -> tuple[float, float, float]:
    return (point[0], -point[1], point[2])


def _both_sides(left) -> np.ndarray:
    return np.array([_mirror(left), left], dtype=float)


@kernel
def attitude_matrix(roll, pitch, yaw, R):
    """Write R = Rz(yaw) Ry(pitch) Rx(roll), body to map, into R (3, 3)."""
    cr, sr = np.cos(roll), np.sin(roll)
    cp, sp = np.cos(pitch), np.sin(pitch)
    cy, sy = np.cos(yaw), np.sin(yaw)
    R[0, 0] = cy * cp
    R[0, 1] = cy * sp * sr - sy * cr
    R[0, 2] = cy * sp * cr + sy * sr
    R[1, 0] = sy * cp
    R[1, 1] = sy * sp * sr + cy * cr
    R[1, 2] = sy * sp * cr - cy * sr
    R[2, 0] = -sp
    R[2, 1] = cp * sr
    R[2, 2] = cp * cr


PLACEMENT = record_type(
    ("steering", float, (6,)),  # angles of the wheels about the z axis of their link [rad]; read
    ("R", float, (3, 3)),  # attitude, body to map; its second column is the axis of all pivots
    ("origin", float, (3,)),  # body origin [m]
    ("centres", float, (6, 3)),  # wheel centres [m]
    ("rocker_pivots", float, (2, 3)),  # rocker pivots [m]
    ("bogie_pivots", float, (2, 3)),  # bogie pivots [m]
    ("part_coms", float, (5, 3)),  # centres of mass of body, rockers and bogies, right first [m]
    ("ahead", float, (3,)),  # horizontal direction in the plane in which the linkage moves
    ("axis", float, (6, 3)),  # wheel axles, positive to the left
    ("forward", float, (6, 3)),  # horizontal directions in the planes of the wheels
    ("up", float, (6, 3)),  # directions in these planes normal to `forward`, upwards
)
"""Positions of a rover's parts in one configuration, map frame.

`place` reads the steering angles and writes the rest.
"""


@kernel
def to_map(placement, point, out, row):
    """Write a point (x, y, z) of the body frame, in the map frame, into row `row` of `out`."""
    R, origin = placement.R, placement.origin
    x, y, z = point
    for i in range(3):
        out[row, i] = origin[i] + R[i, 0] * x + R[i, 1] * y + R[i, 2] * z


@kernel
def pitch_axis(R):
    """Return the horizontal axis (x, y, z), across the heading, about which pitch turns a body."""
    length = np.sqrt(R[0, 0] * R[0, 0] + R[1, 0] * R[1, 0])
    return -R[1, 0] / length, R[0, 0] / length, 0.0


@kernel
def rocker_sign(side):
    """Return the sign of the rocker angle on a side; the differential mirrors the rockers."""
    return 1.0 if side == 0 else -1.0


@kernel
def place(linkage, pose, q, placement):
    """Write the positions of all parts, without the centres of mass, into `placement`.

    Args:
        linkage: LINKAGE.
        pose: (3,) x, y [m] and yaw [rad] of the body origin, map frame.
        q: (6,) z of the body origin [m], roll, pitch, right rocker angle, right and left bogie
            angle [rad].
        placement: PLACEMENT with the steering angles; the rest is written.
    """
    R, origin = placement.R, placement.origin
    attitude_matrix(q[1], q[2], pose[2], R)
    origin[0], origin[1], origin[2] = pose[0], pose[1], q[0]
    for side in range(2):
        rocker, bogie, pivot, hung = _turn_links(linkage, q, side)
        to_map(placement, pivot, placement.rocker_pivots, side)
        to_map(placement, hung, placement.bogie_pivots, side)
        for i in range(3 * side, 3 * side + 3):
            link, wheel = rocker, linkage.wheels[i]
            if linkage.on_bogie[i]:
                link = bogie
                centre = _swing(wheel, linkage.bogie_pivots[side], hung, bogie)
            else:
                centre = _swing(wheel, pivot, pivot, rocker)
            to_map(placement, centre, placement.centres, i)
            _write_axis(placement, i, link)
            _span_wheel_plane(placement, i)
    length = np.sqrt(R[0, 1] * R[0, 1] + R[1, 1] * R[1, 1])
    placement.ahead[0], placement.ahead[1], placement.ahead[2] = (
        R[1, 1] / length,
        -R[0, 1] / length,
        0.0,
    )


@kernel
def place_masses(linkage, q, placement):
    """Write the centres of mass into a placement that `place` has written with q (6,)."""
    coms, body = placement.part_coms, linkage.body_com
    to_map(placement, (body[0], body[1], body[2]), coms, 0)
    for side in range(2):
        rocker, bogie, pivot, hung = _turn_links(linkage, q, side)
        to_map(placement, _swing(linkage.rocker_coms[side], pivot, pivot, rocker), coms, 1 + side)
        own = _swing(linkage.bogie_coms[side], linkage.bogie_pivots[side], hung, bogie)
        to_map(placement, own, coms, 3 + side)


@kernel
def _turn_links(linkage, q, side):
    """Return (cosine, sine) of a side's rocker and bogie, and their pivots, body frame [m]."""
    angle, pivot = rocker_sign(side) * q[3], linkage.rocker_pivots[side]
    rocker = np.cos(angle), np.sin(angle)
    bogie = np.cos(angle + q[4 + side]), np.sin(angle + q[4 + side])
    own = pivot[0], pivot[1], pivot[2]
    return rocker, bogie, own, _swing(linkage.bogie_pivots[side], own, own, rocker)


@kernel
def _swing(point, pivot, moved, turn):
    """Return a point (3,) of a link that turns about its pivot, which has moved; body frame [m].

    `turn` is (cosine, sine) of the link's angle about body y.
    """
    (c, s), dx, dz = turn, point[0] - pivot[0], point[2] - pivot[2]
    return moved[0] + c * dx + s * dz, point[1], moved[2] - s * dx + c * dz


@kernel
def _write_axis(placement, wheel, link):
    """Write the axle of a wheel, turned about the z axis of its link.

    `link` is the (cosine, sine) of the link's angle about body y.
    """
    R, axis = placement.R, placement.axis
    angle = placement.steering[wheel]
    if angle == 0.0:
        for i in range(3):
            axis[wheel, i] = R[i, 1]
        return
    link_c, link_s = link
    s, c = np.sin(angle), np.cos(angle)
    for i in range(3):
        axis[wheel, i] = c * R[i, 1] - s * (link_c * R[i, 0] - link_s * R[i, 2])


@kernel
def _span_wheel_plane(placement, wheel):
    """Write the two directions in the plane of a wheel."""
    axis, forward, up = placement.axis[wheel], placement.forward[wheel], placement.up[wheel]
    length = np.sqrt(axis[0] * axis[0] + axis[1] * axis[1])
    forward[0], forward[1], forward[2] = axis[1] / length, -axis[0] / length, 0.0
    up[0] = forward[1] * axis[2]
    up[1] = -forward[0] * axis[2]
    up[2] = forward[0] * axis[1] - forward[1] * axis[0]
