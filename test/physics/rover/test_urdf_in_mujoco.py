# SPDX-License-Identifier: Apache-2.0
"""MuJoCo reads the URDF of a rover as the model has it: masses, wheels, and the differential."""

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

from rover_physics import load_rover
from rover_physics.names import WHEELS
from rover_physics.rover.urdf.write_urdf import write_urdf
from support.rover_geometry import place_rover, wheel_axes

ROCKER, BOGIES, TURN = 0.2, np.array([0.3, -0.25]), 0.4
"""Angles of the right rocker, of both bogies and of the steered wheels [rad]."""


@pytest.mark.parametrize("name", ["lsr1", "m2020"])
def test_mujoco_has_masses_and_wheels_of_the_urdf_where_the_model_has_them(name, tmp_path):
    rover, urdf = load_rover(name), tmp_path / "rover.urdf"
    write_urdf(urdf, rover)
    spec = mujoco.MjSpec.from_file(str(urdf))
    spec.body("base_link").add_freejoint()
    ((mimic,), model) = spec.equalities, spec.compile()
    assert {mimic.name1, mimic.name2} == {"rocker_right", "rocker_left"}
    assert mimic.data[:2].tolist() == [0.0, -1.0]  # one side goes up as the other goes down
    assert model.body_mass.sum() == pytest.approx(rover.total_mass)
    data, steering = mujoco.MjData(model), np.zeros((1, 6))
    angles = {"rocker_right": ROCKER, "rocker_left": -ROCKER}
    angles |= dict(zip(("bogie_right", "bogie_left"), BOGIES, strict=True))
    if rover.manipulator is not None:
        angles |= dict(zip(rover.manipulator.joints, rover.manipulator.stowed, strict=True))
    for wheel, side_and_place in enumerate(WHEELS):
        if side_and_place.split("_")[0] in rover.steering.wheels:
            angles[f"{side_and_place}_steering"] = steering[0, wheel] = TURN
    for joint, angle in angles.items():
        data.joint(joint).qpos = angle
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    posed = SimpleNamespace(
        rocker_angle=np.array([[ROCKER, -ROCKER]]), bogie_angle=BOGIES[None],
        steering_angle=steering, roll=[0.0], pitch=[0.0], poses=np.zeros((1, 3)),
        position=np.zeros((1, 3)),
    )  # fmt: skip
    placed, bodies = place_rover(rover, posed, 0), [data.body(wheel) for wheel in WHEELS]
    masses, places, *_ = zip(*placed.masses, strict=True)
    com = np.average(places, axis=0, weights=masses)
    np.testing.assert_allclose(data.subtree_com[0], com, atol=1e-9)
    centres = np.array([body.xpos for body in bodies])
    np.testing.assert_allclose(centres, placed.wheels, atol=1e-9)
    axes = np.array([body.xmat.reshape(3, 3)[:, 1] for body in bodies])
    np.testing.assert_allclose(axes, wheel_axes(rover, posed, 0), atol=1e-9)
