# SPDX-License-Identifier: Apache-2.0
"""MuJoCo loads the URDF of a rover and settles it where the model does."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from rover_physics import Terrain, judge_poses, load_rover
from rover_physics.names import WHEELS
from rover_physics.numerics.quaternions import forward_from_xyzw, wxyz_from_rpy, xyzw_from_wxyz
from rover_physics.rover.urdf.write_urdf import write_urdf

TIMESTEP = 1e-3
"""[s]"""
BRAKE = 0.1
"""Friction of braked joints over the rover's weight [m]."""
LONGEST = 15.0
"""Simulated time after which a rover that still moves counts as not settled [s]."""
AT_REST = 1e-3
"""Speed of all degrees of freedom [m/s, rad/s] below which the rover is at rest."""


class UrdfRover:
    """The rover of a URDF file above a terrain; its wheels are braked."""

    def __init__(self, urdf: Path, terrain: Terrain, gravity: float, held: dict[str, float]):
        """Load a file of `write_urdf`, with joints of the arm `held` at angles [rad]."""
        spec = mujoco.MjSpec.from_file(str(urdf))
        spec.compiler.fusestatic = False  # the arm's tip is a link
        spec.option.timestep, spec.option.gravity = TIMESTEP, [0.0, 0.0, -gravity]
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        spec.option.cone, spec.option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, 10.0
        _add_ground(spec, terrain)
        spec.body("base_link").add_freejoint()
        for geom in spec.geoms:
            geom.friction, geom.condim = [0.8, 0.0, 0.0], 3
            geom.solref, geom.solimp = [0.004, 1.0], [0.98, 0.99, 0.001, 0.5, 2.0]
        for equality in spec.equalities:  # the mimic of the file: the differential
            equality.solref[:2], equality.solimp[:2] = [0.004, 1.0], [0.9999, 0.9999]
        weight = gravity * sum(body.mass for body in spec.bodies)
        for joint in spec.joints:
            joint.damping[0], joint.armature = 1e-3 * weight, 0.001
            if joint.name.endswith(("_wheel", "_steering")) or joint.name in held:
                joint.frictionloss = BRAKE * weight
                joint.solref_friction = [0.004, 1.0]
                joint.solimp_friction = [0.9999, 0.9999, 0.001, 0.5, 2.0]
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self._terrain, self._held = terrain, held
        self._wheels = [self.model.body(name).id for name in WHEELS]

    def settle(self, x: float, y: float, yaw: float) -> tuple[np.ndarray, np.ndarray]:
        """Drop the level rover; return x, y, yaw (3,) and wheel centres (6, 3) at rest."""
        model, data = self.model, self.data
        mujoco.mj_resetData(model, data)
        for name, angle in self._held.items():
            data.joint(name).qpos = angle
        data.qpos[:3] = x, y, 0.0
        data.qpos[3:7] = wxyz_from_rpy(0.0, 0.0, yaw)
        mujoco.mj_forward(model, data)
        lowest = data.xpos[self._wheels, 2].min() - 0.3
        data.qpos[2] = np.nanmax(self._terrain.elevation) - lowest
        still = 0
        for _ in range(round(LONGEST / TIMESTEP)):
            mujoco.mj_step(model, data)
            still = still + 1 if np.abs(data.qvel).max() < AT_REST else 0
            if still * TIMESTEP >= 0.05:
                forward_x, forward_y = forward_from_xyzw(xyzw_from_wxyz(data.qpos[3:7]))
                pose = np.array([data.qpos[0], data.qpos[1], np.arctan2(forward_y, forward_x)])
                return pose, data.xpos[self._wheels].copy()
        raise AssertionError(f"still moves at {np.abs(data.qvel).max():g} m/s")


def _add_ground(spec: mujoco.MjSpec, terrain: Terrain) -> None:
    """Add the height field of a terrain."""
    rows, columns = terrain.elevation.shape
    low, span = terrain.elevation.min(), max(float(np.ptp(terrain.elevation)), 1e-3)
    half = 0.5 * terrain.resolution * np.array([columns - 1, rows - 1])
    spec.add_hfield(
        name="ground", nrow=rows, ncol=columns, size=[*half, span, 1.0],
        userdata=((terrain.elevation - low) / span).ravel().tolist(),
    )  # fmt: skip
    middle = np.array(terrain.origin) + half
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname="ground", pos=[*middle, low]
    )


def bumps(length: float, height: float, cell: float) -> Terrain:
    """Return waves across each other, 6 m wide."""
    x = np.arange(-3.0, 3.0 + 0.5 * cell, cell)
    X, Y = np.meshgrid(x, x)
    waves = np.sin(2.0 * np.pi * X / length + 0.3) * np.cos(2.0 * np.pi * Y / (1.3 * length))
    return Terrain(height * waves, cell, (-3.0, -3.0))


@pytest.mark.parametrize(
    ("name", "ground", "apart"),
    [("m2020", bumps(2.5, 0.12, 0.05), 5e-4), ("lsr1", bumps(1.2, 0.05, 0.02), 1e-4)],
)
def test_mujoco_loads_the_urdf_and_settles_it_in_the_same_pose(name, ground, apart, tmp_path):
    rover = load_rover(name)
    arm = rover.manipulator
    held = {} if arm is None else dict(zip(arm.joints, arm.stowed, strict=True))
    urdf = tmp_path / "rover.urdf"
    write_urdf(urdf, rover)
    simulated = UrdfRover(urdf, ground, rover.gravity, held)
    assert simulated.model.body_mass.sum() == pytest.approx(rover.total_mass)
    for place in ((0.0, 0.0, 0.0), (0.2, -0.1, 0.7), (-0.3, 0.2, -2.0)):
        pose, centres = simulated.settle(*place)
        predicted = judge_poses(rover, ground, pose[None], np.zeros(1))[0]
        assert predicted.settled[0]
        np.testing.assert_allclose(predicted.wheel_centres[0], centres, rtol=0.0, atol=apart)
