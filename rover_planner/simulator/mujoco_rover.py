# SPDX-License-Identifier: Apache-2.0
"""The plant that simulates a rover on rigid ground in MuJoCo, with inertia and wheel slip.

It needs the package mujoco (extra `bench`). It shares only the rover's numbers with the model of
`rover_physics`. The simulation has rigid bodies, hinges, a differential that couples the rockers,
cylindrical wheels on a height field, and dry friction.
"""

import math
from dataclasses import dataclass

import mujoco
import numpy as np

from rover_physics.names import SUSPENSION_JOINTS, WHEEL_JOINTS, WHEELS
from rover_physics.numerics.arrays import Floats
from rover_physics.numerics.quaternions import (
    matrix_from_xyzw,
    rpy_from_xyzw,
    xyzw_from_wxyz,
)
from rover_physics.rover.model import Rover
from rover_physics.rover.steered_drive import SteeredDrive
from rover_physics.rover.steering_joints import steered_wheels, steering_joints
from rover_physics.terrain.grid import Terrain
from rover_planner.errors import PlanningError
from rover_planner.simulator.mujoco_model import thin_out, write_model
from rover_planner.simulator.plant import PlantState

TIMESTEP, LONGEST_TIMESTEP = 0.004, 0.04
"""Time step of the simulation [s]; a part of it for small rovers, for which it is longer than
LONGEST_TIMESTEP times sqrt(wheel radius / gravity)."""
DROPS = 5.0
"""The rover is dropped from the height of a wheel radius over this."""
SETTLING_TIME = 3.0
"""Time for which the servos hold the wheels after the drop, until the rover is at rest [s]."""
SERVO_SHARE = 0.5
"""Share of a speed error that a servo corrects in one step of the simulation."""
SERVO_RATE = 5.0
"""Integral gain of a servo over its gain [1/s]."""
MIN_LOAD = 1e-3
"""Load above which a wheel has ground contact, as a share of the rover's weight."""
DERATING_SHARE = 0.2
"""Share of the maximum speed, at its upper end, over which the motor torque falls to zero."""
MAX_TILT = 1.2
"""Tilt above which a rover counts as tipped over [rad]."""

_WHEELS = slice(len(SUSPENSION_JOINTS), len(SUSPENSION_JOINTS) + len(WHEEL_JOINTS))
"""The wheel joints among the joints of the rover."""


@dataclass(frozen=True, eq=False)
class WheelContacts:
    """Contact forces and slip of the wheels at one time."""

    loads: Floats
    """(6,) sums of normal forces [N]."""
    shears: Floats
    """(6,) sums of the magnitudes of tangential forces [N]."""
    slip_speeds: Floats
    """(6,) slip speeds of the treads [m/s], load-weighted means; zero without contact."""


def find_timestep(rover: Rover) -> float:
    """Return the time step [s] that suits a rover; TIMESTEP is a multiple of it."""
    longest = LONGEST_TIMESTEP * math.sqrt(rover.wheel.radius / rover.gravity)
    return TIMESTEP / math.ceil(TIMESTEP / longest)


class MujocoRover:
    """A rover on one terrain, moved by speeds or torques; with fixed wheels it skids in curves."""

    def __init__(
        self,
        rover: Rover,
        terrain: Terrain,
        pose: tuple[float, float, float] = (0.0, 0.0, 0.0),
        friction: float | None = None,
        timestep: float | None = None,
    ):
        """Drop a rover onto the ground and simulate until it is at rest.

        Args:
            rover: The rover.
            terrain: The ground without unknown cells. Where it has a friction layer, a wheel has
                the friction of the cell below its centre.
            pose: x, y [m] and yaw [rad] of the body's origin.
            friction: Friction coefficient where the terrain has none; None takes the rover's.
            timestep: Time step of the simulation [s]; None takes that of `find_timestep`.

        Raises:
            PlanningError: The terrain has unknown cells, or the pose is outside the terrain.
        """
        if not np.isfinite(terrain.elevation).all():
            raise PlanningError("terrain has unknown cells; a plant needs all of them known")
        self.rover, self.terrain = rover, terrain
        self.friction = rover.friction if friction is None else friction
        self._model = mujoco.MjModel.from_xml_string(
            write_model(rover, terrain, self.friction, timestep or find_timestep(rover))
        )
        elevation = thin_out(terrain.elevation)
        span = np.ptp(elevation)
        heights = (elevation - elevation.min()) / (span if span > 0.0 else 1.0)
        self._model.hfield_data[:] = heights.ravel()
        self._data = mujoco.MjData(self._model)
        self._steered = steered_wheels(rover)
        self._joints = (*SUSPENSION_JOINTS, *WHEEL_JOINTS, *steering_joints(rover))
        numbers = [self._model.joint(name).id for name in self._joints]
        self._positions = self._model.jnt_qposadr[numbers]
        self._velocities = self._model.jnt_dofadr[numbers]
        geoms = {self._model.geom(name).id: k for k, name in enumerate(WHEELS)}
        self._wheel_of = np.full(self._model.ngeom, -1)
        for geom, wheel in geoms.items():
            self._wheel_of[geom] = wheel
        self._wheel_geoms = np.array(list(geoms))
        if terrain.friction is not None:
            # Of two bodies in contact the larger friction holds: let it be the wheel's.
            self._model.geom_friction[self._model.geom("ground").id, 0] = 0.0
        self._inertia = float(self._model.dof_M0[self._velocities[_WHEELS][-1]])
        self._drive, self._aims = SteeredDrive(rover), np.zeros(len(self._steered))
        self.refusal = ""
        """Why the rover cannot follow the last command; empty if it can."""
        self._integral = np.zeros(6)
        self._bodies = np.array([self._model.body(name).id for name in WHEELS])
        self._arms = np.repeat([1.0, -1.0], 3) * abs(rover.suspension.wheels["middle"][1])
        self._drop(pose)
        self._torques, self._velocity, self._last = np.zeros(6), np.zeros(3), self.position

    def _drop(self, pose: tuple[float, float, float]) -> None:
        x, y, yaw = pose
        highest = self._height_above_ground(x, y, yaw)
        if not np.isfinite(highest):
            raise PlanningError(f"a rover at {pose} stands beyond the terrain")
        drop = self.rover.wheel.radius / DROPS
        self._data.qpos[:7] = x, y, highest + drop, np.cos(yaw / 2), 0, 0, np.sin(yaw / 2)
        mujoco.mj_forward(self._model, self._data)
        self.servo(np.zeros(6), SETTLING_TIME)
        self._data.time = 0.0

    def _height_above_ground(self, x: float, y: float, yaw: float) -> float:
        """Return the smallest z [m] of a level rover at which no wheel penetrates the ground."""
        radius, width = self.rover.wheel.radius, self.rover.wheel.width
        ahead, across = np.meshgrid(
            np.linspace(-radius, radius, 21), np.linspace(-0.5 * width, 0.5 * width, 9)
        )
        c, s = np.cos(yaw), np.sin(yaw)
        highest = []
        for px, py, pz in self.rover.suspension.wheels.values():
            for side in (-1.0, 1.0):
                wx, wy = px + ahead, side * py + across
                ground = self.terrain.elevation_at(x + c * wx - s * wy, y + s * wx + c * wy)
                highest.append(np.max(ground + np.sqrt(radius**2 - ahead**2) - pz))
        return float(np.max(highest))

    def drive(self, speed: float, yaw_rate: float, duration: float) -> None:
        """Drive at a speed [m/s] and yaw rate [rad/s] for a duration [s], with speed servos."""
        speed, yaw_rate = self._drive.clip(speed, yaw_rate)
        if self.rover.steering is None:
            speeds = speed + yaw_rate * self._arms
        else:
            speeds = self.steer((speed, yaw_rate))
        self._note(self.servo(speeds / self.rover.wheel.radius, duration), duration)

    def pull(self, torques: Floats, command: tuple[float, float], duration: float) -> None:
        """Apply torques (6,) [N m] for a duration [s]; speed and yaw rate set the steering.

        With fixed wheels the torques also steer.
        """
        self.steer(command)
        self.step(torques, duration)
        self._note(torques, duration)

    def brake(self, duration: float) -> None:
        """Lock the wheels for a duration [s] by dry friction at their axles."""
        wheels, torques = self._velocities[_WHEELS], np.zeros(6)
        self._model.dof_frictionloss[wheels] = self.rover.weight * self.rover.wheel.radius
        self.step(torques, duration)
        self._model.dof_frictionloss[wheels] = 0.0
        self._integral[:] = 0.0
        self._note(torques, duration)

    def _note(self, torques: Floats, duration: float) -> None:
        """Note the torques (6,) [N m] and the mean velocity of the last duration [s]."""
        moved = (self.position - self._last) / duration
        self._torques, self._velocity = torques, self._rotation.T @ moved
        self._last = self.position

    def step(self, torques: Floats, duration: float) -> None:
        """Apply torques (6,) [N m] in wheel order for a duration [s]; motor limits apply."""
        for _ in range(max(round(duration / self._model.opt.timestep), 1)):
            self._advance(self._limit(torques))

    def steer(self, command: tuple[float, float]) -> Floats:
        """Steer towards a speed [m/s] and yaw rate [rad/s]; return the wheels' speeds meanwhile.

        The steered wheels turn at their largest rate. A rover that is to stand, or cannot follow
        the command, keeps its steering angles.

        Returns:
            Speeds (6,) [m/s].
        """
        aims = self._drive.aim(*command)
        self.refusal = aims.refusal
        if self.refusal or not any(command):
            return np.zeros(6)
        self._aims = aims.angles[self._steered]
        return self._drive.share(self.steering_angles, aims.angles) * aims.speeds

    def _advance(self, inputs: Floats) -> None:
        """Advance by a step of the simulation.

        `inputs` (6,) are what the wheels' actuators take: torques [N m] within the limits, or
        rates [rad/s] of servos with droop.
        """
        control = self._data.ctrl
        control[:6] = inputs
        if self.terrain.friction is not None:
            self._model.geom_friction[self._wheel_geoms, 0] = self._find_friction()
        if self.rover.steering is not None:
            most = self.rover.steering.rate * self._model.opt.timestep
            control[6:] += np.clip(self._aims - control[6:], -most, most)
        mujoco.mj_step(self._model, self._data)

    def _find_friction(self) -> Floats:
        """Return the friction (6,) of the cells below the wheels."""
        assert self.terrain.friction is not None
        origin, cells = np.array(self.terrain.origin), np.array(self.terrain.friction.shape)
        places = (self._data.xpos[self._bodies, :2] - origin) / self.terrain.resolution
        rows, columns = np.clip(np.rint(places[:, ::-1]).astype(int), 0, cells - 1).T
        layer = self.terrain.friction[rows, columns]
        return np.where(layer > 0.0, layer, self.friction)

    def _limit(self, torques: Floats) -> Floats:
        """Limit torques (6,) [N m] to those of the motors, zero above their maximum speed."""
        wheel, rates = self.rover.wheel, self.wheel_rates
        derating = DERATING_SHARE * wheel.max_speed
        share = np.clip((wheel.max_speed - np.abs(rates)) / derating, 0.0, 1.0)
        limit = np.where(rates * torques > 0.0, share, 1.0) * wheel.max_torque
        return np.clip(torques, -limit, limit)

    def servo(self, rates: Floats, duration: float) -> Floats:
        """Drive the wheels at rates (6,) [rad/s] for a duration [s] with speed servos.

        Each wheel has a PI controller that runs at every simulation step. Its integral does not
        grow while the torque is limited (anti-windup).

        Returns:
            Torques (6,) of the last step [N m].
        """
        step = self._model.opt.timestep
        gain = SERVO_SHARE * self._inertia / step
        for _ in range(max(round(duration / step), 1)):
            error = rates - self.wheel_rates
            wanted = gain * error + self._integral
            torques = self._limit(wanted)
            self._integral += np.where(wanted == torques, SERVO_RATE * gain * step * error, 0.0)
            self._advance(torques)
        return torques

    def servo_with_droop(self, rates: Floats, droop: float, duration: float) -> Floats:
        """Drive the wheels at rates (6,) [rad/s] for a duration [s] with proportional servos.

        A servo has its largest torque when its wheel is `droop` times the nominal wheel speed
        slower than its rate. MuJoCo takes its gain into the implicit part of a step.

        Returns:
            Torques (6,) of the last step [N m].
        """
        model, wheel, motors = self._model, self.rover.wheel, slice(len(WHEEL_JOINTS))
        gain = wheel.max_torque * wheel.radius / (droop * self.rover.nominal_speed)
        kinds = model.actuator_biastype[motors].copy()
        model.actuator_biastype[motors] = mujoco.mjtBias.mjBIAS_AFFINE
        model.actuator_gainprm[motors, 0], model.actuator_biasprm[motors, 2] = gain, -gain
        model.actuator_forcerange[motors] = -wheel.max_torque, wheel.max_torque
        model.actuator_forcelimited[motors] = 1
        for _ in range(max(round(duration / model.opt.timestep), 1)):
            self._advance(rates)
        torques = self._data.actuator_force[motors].copy()
        model.actuator_gainprm[motors, 0], model.actuator_biasprm[motors, 2] = 1.0, 0.0
        model.actuator_biastype[motors], model.actuator_forcelimited[motors] = kinds, 0
        return torques

    @property
    def time(self) -> float:
        """Time since the rover came to rest [s]."""
        return float(self._data.time)

    @property
    def position(self) -> Floats:
        """Place (3,) of the body's origin [m]."""
        return self._data.qpos[:3].copy()

    def pose(self) -> Floats:
        """Return x, y [m] and yaw [rad] (3,) of the body's origin."""
        return np.array([*self._data.qpos[:2], rpy_from_xyzw(self.orientation)[2]])

    @property
    def orientation(self) -> Floats:
        """Quaternion (4,) x, y, z, w of the body in the map frame."""
        return xyzw_from_wxyz(self._data.qpos[3:7])

    @property
    def _rotation(self) -> Floats:
        """Rotation matrix (3, 3), body to map."""
        return matrix_from_xyzw(self.orientation)

    @property
    def attitude(self) -> tuple[float, float]:
        """Roll and pitch [rad], R = Rz(yaw) Ry(pitch) Rx(roll)."""
        return rpy_from_xyzw(self.orientation)[:2]

    @property
    def body_rates(self) -> Floats:
        """Angular velocity (3,) in the body frame [rad/s]."""
        return self._data.qvel[3:6].copy()

    @property
    def joint_positions(self) -> dict[str, float]:
        """Angles [rad] of suspension, wheels and steering by joint name."""
        values = self._data.qpos[self._positions].tolist()
        return dict(zip(self._joints, values, strict=True))

    @property
    def joint_velocities(self) -> dict[str, float]:
        """Rates [rad/s] of suspension, wheels and steering by joint name."""
        values = self._data.qvel[self._velocities].tolist()
        return dict(zip(self._joints, values, strict=True))

    @property
    def steering_angles(self) -> Floats:
        """Steering angles (6,) [rad], 0 for fixed wheels."""
        angles = np.zeros(6)
        angles[self._steered] = self._data.qpos[self._positions[_WHEELS.stop :]]
        return angles

    @property
    def wheel_rates(self) -> Floats:
        """Rates (6,) of the wheel joints in wheel order [rad/s]."""
        return self._data.qvel[self._velocities[_WHEELS]].copy()

    @property
    def wheel_torques(self) -> Floats:
        """Torques (6,) that the motors gave in the last step, in wheel order [N m]."""
        return self._data.actuator_force[: len(WHEEL_JOINTS)].copy()

    @property
    def tilt(self) -> float:
        """Angle between body z and the vertical [rad]."""
        return float(np.arccos(np.clip(self._rotation[2, 2], -1.0, 1.0)))

    def state(self) -> PlantState:
        """Return the current measurements; velocity and torques are those of the last drive."""
        return PlantState(
            position=self.position,
            orientation=self.orientation,
            velocity=self._velocity,
            body_rates=self.body_rates,
            joint_positions=self.joint_positions,
            joint_velocities=self.joint_velocities,
            wheel_torques=self._torques,
            stopped="the rover has tipped over" if self.tilt > MAX_TILT else self.refusal,
        )

    def measure_contacts(self) -> WheelContacts:
        """Measure forces and slip of all wheels."""
        model, data = self._model, self._data
        loads, shears, slips = np.zeros(6), np.zeros(6), np.zeros(6)
        force, velocity = np.zeros(6), np.zeros(6)
        for k, contact in enumerate(data.contact[: data.ncon]):
            wheel = max(self._wheel_of[contact.geom1], self._wheel_of[contact.geom2])
            if wheel < 0:
                continue
            mujoco.mj_contactForce(model, data, k, force)
            body = self._bodies[wheel]
            mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, body, velocity, 0)
            arm = contact.pos - data.xpos[body]
            tread = velocity[3:] + np.cross(velocity[:3], arm)
            normal = contact.frame[:3]
            sliding = np.linalg.norm(tread - normal * (normal @ tread))
            loads[wheel] += force[0]
            shears[wheel] += np.hypot(force[1], force[2])
            slips[wheel] += force[0] * sliding
        held = loads > MIN_LOAD * self.rover.weight
        slip_speeds = np.where(held, slips / np.where(held, loads, 1.0), 0.0)
        return WheelContacts(loads, shears, slip_speeds)
