# SPDX-License-Identifier: Apache-2.0
"""Equations (1) to (15) of the paper hold on settled poses and the forces found there.

The paper: Hacot, Dubowsky and Bidaud, "Analysis and Simulation of a Rocker-Bogie Exploration
Rover". Misprints are mended as docs/physics.md lists them. (1) and (3) to (7) are tested in
3-D, to rounding error, on rough ground; (2), a wheel on the ground, in test_rough_poses.py. (8) to
(15) are tested as the paper has them, with weightless links, for small roll; in 3-D, with all
weights, they are the nine sums of test_equilibrium.py.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from rover_physics import PathPrediction, Rover, Terrain, judge_path, load_rover
from rover_physics.rover.model import Part
from support.grounds import make_terrain
from support.rough_grounds import fractal, random_poses, rocky, smooth
from support.rover_geometry import UP, attitude_of, place_rover

LSR1 = load_rover("lsr1")


def waves_and_side_slope(roll: float) -> Terrain:
    """Return waves along x on a slope along y: it rolls the rover everywhere by about `roll`."""
    return make_terrain(lambda x, y: 0.06 * np.sin(2.0 * x) + np.tan(roll) * y, 0.02, 2.0)


ALONG_WAVES = np.column_stack([np.linspace(-1.0, 1.0, 41), np.zeros(41), np.zeros(41)])


def weightless_links(rover: Rover) -> Rover:
    """Return `rover` with all its mass in the body, at the origin between the rocker pivots."""
    tiny = 1e-12
    masses = rover.masses
    body = Part(rover.total_mass, (0.0, 0.0, 0.0))
    links = {name: replace(getattr(masses, name), mass=tiny) for name in ("rocker", "bogie")}
    return replace(
        rover,
        wheel=replace(rover.wheel, mass=tiny),
        masses=replace(masses, body=body, **links),
        manipulator=None,
    )


# Kinematics: eqs (1) to (7)


class Links(NamedTuple):
    """The paper's lengths and angles of a rover with the bogie ahead, see docs/physics.md."""

    l1: float
    l2: float
    l3: float
    l4: float
    alpha: float
    beta: float
    gamma: float
    middle: float
    """Elevation of the middle wheel from the bogie pivot on flat ground [rad]."""
    w: float


def links_of(rover: Rover) -> Links:
    def link(start, end):
        along, up = end[0] - start[0], end[2] - start[2]
        return np.hypot(along, up), np.arctan2(up, along)

    suspension = rover.suspension
    l1, rear = link(suspension.rocker_pivot, suspension.wheels["rear"])
    l2, bogie = link(suspension.rocker_pivot, suspension.bogie_pivot)
    l3, middle = link(suspension.bogie_pivot, suspension.wheels["middle"])
    l4, front = link(suspension.bogie_pivot, suspension.wheels["front"])
    w = 2.0 * suspension.rocker_pivot[1]
    return Links(l1, l2, l3, l4, bogie - rear, front - middle, rear, middle, w)


def closure(rover: Rover, prediction: PathPrediction, i: int) -> dict:
    """Return what is left of eqs (1) and (3) to (7), by their numbers [rad, m].

    The paper's roll is the camber of the wheels, positive when the right side is high; its link
    angles are elevations in the plane of the wheels.
    """
    k = links_of(rover)
    R = attitude_of(prediction, i)
    nose_up, roll = np.arctan2(R[2, 0], R[2, 2]), -np.arcsin(R[2, 1])
    rockers = nose_up - prediction.rocker_angle[i]
    theta1, theta3 = k.gamma + rockers
    theta2, theta4 = k.middle + rockers - prediction.bogie_angle[i]
    z1r, z2r, z3r, z1l, z2l, z3l = prediction.wheel_centres[i, :, 2]
    c, s = np.cos(roll), np.sin
    across = k.w * s(roll)
    to_pivot = k.l3 * s(theta2) + k.l2 * s(theta1 + k.alpha)
    to_left_bogie = to_pivot - k.l2 * s(theta3 + k.alpha)
    return {
        1: (theta1 + theta3) / 2.0 - k.gamma - nose_up,
        3: z2r - z3r - c * (k.l3 * s(theta2) - k.l4 * s(theta2 + k.beta)),
        4: z2r - z1r - c * (to_pivot - k.l1 * s(theta1)),
        5: z2r - z1l - c * (to_pivot - k.l1 * s(theta3)) - across,
        6: z2r - z2l - c * (to_left_bogie - k.l3 * s(theta4)) - across,
        7: z2r - z3l - c * (to_left_bogie - k.l4 * s(theta4 + k.beta)) - across,
    }


def test_eqs_1_and_3_to_7_hold_in_3d_wherever_the_rover_settles():
    grounds, poses = [make(11) for make in (smooth, fractal, rocky)], random_poses(2, 30, 0.5)
    for prediction in [judge_path(LSR1, ground, poses)[0] for ground in grounds]:
        for i in np.flatnonzero(prediction.settled):
            assert max(map(abs, closure(LSR1, prediction, i).values())) <= 1e-12


# Forces: eqs (8) to (15)


def frame_of(prediction: PathPrediction, i: int) -> np.ndarray:
    """Return rows x ahead and level, y along the wheels' axis, z up in the wheels' plane."""
    axis = attitude_of(prediction, i)[:, 1]
    ahead = np.cross(axis, UP) / np.linalg.norm(np.cross(axis, UP))
    return np.array([ahead, axis, np.cross(ahead, axis)])


def planar_sides(rover: Rover, prediction: PathPrediction, i: int) -> tuple[np.ndarray, ...]:
    """Cut both rockers off the body: (12) to (15) in the plane, links without weight or width.

    Return what the sides, right first, do to the body at the rocker pivots, forces (2, 3) [N] and
    moments (2, 3) [N m], and the moments (2,) about the bogie pivots of what hangs on the bogies.
    """
    placed, frame = place_rover(rover, prediction, i), frame_of(prediction, i)
    angle, N, T, S = (
        getattr(prediction, name)[i]
        for name in ("contact_angle", "wheel_loads", "tangential", "lateral")
    )
    fx, fz = T * np.cos(angle) - N * np.sin(angle), T * np.sin(angle) + N * np.cos(angle)
    points = prediction.contact_points[i]
    force, moment, bogie = np.zeros((2, 3)), np.zeros((2, 3)), np.zeros(2)
    for k in range(6):
        side = k // 3
        x, _, z = frame @ (points[k] - placed.rocker_pivots[side])
        force[side] += fx[k], S[k], fz[k]
        moment[side] += -z * S[k], z * fx[k] - x * fz[k], x * S[k]
        if placed.on_bogie[k]:
            x, _, z = frame @ (points[k] - placed.bogie_pivots[side])
            bogie[side] += z * fx[k] - x * fz[k]
    return force, moment, bogie


@pytest.mark.parametrize("roll", [0.03, -0.1])
def test_eqs_8_to_15_hold_for_small_roll_as_the_paper_has_them(roll):
    """What the paper leaves out explains all that is left.

    It takes W for W cos(roll) in (10): an error of roll^2 / 2. It neglects the width of the side
    assemblies in (9) and (11): forces times the distance of the contacts from the middle of the
    wheels, which is under 4 mm on this ground. The links of this rover weigh nothing.
    """
    rover = weightless_links(LSR1)
    prediction = judge_path(rover, waves_and_side_slope(roll), ALONG_WAVES)[0]
    assert prediction.settled.all()
    w, W = 2.0 * rover.suspension.rocker_pivot[1], rover.weight
    for i in range(len(ALONG_WAVES)):
        (right, left), (m_right, m_left), bogie = planar_sides(rover, prediction, i)
        tolerance = 1e-6 * W
        frame, centres = frame_of(prediction, i), prediction.wheel_centres[i]
        aside = np.abs((prediction.contact_points[i] - centres) @ frame[1])
        assert aside.max() <= 4e-3
        turning = np.hypot(prediction.tangential[i], prediction.wheel_loads[i]) @ aside
        assert right[0] + left[0] == pytest.approx(0.0, abs=tolerance), "(8)"
        turn = (right[0] - left[0]) * w / 2 + m_right[2] + m_left[2]
        assert abs(turn) <= turning + tolerance, "(9)"
        assert abs(right[2] + left[2] - W) <= W * prediction.roll[i] ** 2 / 2 + tolerance, "(10)"
        tip = (left[2] - right[2]) * w / 2 + m_right[0] + m_left[0]
        assert abs(tip) <= turning + tolerance, "(11)"
        assert m_right[1] == pytest.approx(m_left[1], abs=tolerance), "(14)"
        assert m_right[1] + m_left[1] == pytest.approx(0.0, abs=tolerance), "(14)"
        assert np.abs(bogie).max() <= tolerance, "(15)"
