"""The plant that simulates a quasi-static rover: it moves from one equilibrium to the next.

With a commanded speed, the rover moves if the model allows it; otherwise it stops with the model's
reason. With commanded torques, the balance of forces decides: the traction beyond the force that
holds the rover on its slope accelerates its mass, and wheel force beyond friction is lost as slip.
The forward speed is the only state with inertia. Limits of attitude, suspension and clearance
apply in both cases.
"""

from dataclasses import fields, replace

import numpy as np

from rover_physics.forces.soil import coulomb_slip
from rover_physics.names import EQUAL, OPTIMAL, SUSPENSION_JOINTS, WHEEL_JOINTS
from rover_physics.numerics.arrays import Floats
from rover_physics.numerics.quaternions import xyzw_from_rpy
from rover_physics.prediction.path_prediction import PathPrediction
from rover_physics.prediction.sweep import sweep_path
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traction.balance import BalanceWriter
from rover_physics.traversability.verdict import find_reasons
from rover_planner.errors import PlanningError
from rover_planner.simulator.driving_forces import DrivingForces, find_driving_forces
from rover_planner.simulator.plant import PlantState

DRAG = 0.5
"""Damping of the speed by the gears: deceleration over speed [1/s]."""
MAX_SLIP = 0.95
"""Largest slip ratio that is used for wheel rates, which would be infinite at 1."""
CREEP = 1e-4
"""Speed below which the rover does not steer [m/s]."""
MIN_PROGRESS, PATIENCE = 0.02, 2.0
"""A rover that moves less than MIN_PROGRESS [m] within PATIENCE [s] counts as stuck."""
NO_LIMIT = 1e9
"""Value that disables a limit."""


class QuasiStaticPlant:
    """One rover on one terrain; the module's docstring describes its dynamics."""

    def __init__(
        self,
        rover: Rover,
        terrain: Terrain,
        pose: tuple[float, float, float],
        friction: float | None = None,
        policy: str = EQUAL,
        soil: str | None = None,
    ):
        """Place a rover on the ground.

        Args:
            rover: The rover.
            terrain: The ground.
            pose: x, y [m] and yaw [rad] of the body origin.
            friction: Coulomb friction; None takes that of the terrain or the rover.
            policy: How the servos share the traction, one of CONTROL_POLICIES.
            soil: Preset soil where the terrain names none; None: Coulomb friction.

        Raises:
            PlanningError: The rover cannot stand at the pose.
            SoilError: No soil of that name.
        """
        self._rover, self._terrain = rover, terrain
        self._friction, self._policy, self._soil = friction, policy, soil
        self._writer = BalanceWriter(rover)
        self._mass = self._writer.weight / rover.gravity
        limits = replace(rover.limits, friction_utilisation=NO_LIMIT, torque_saturation=NO_LIMIT)
        self._without_force_limits = replace(rover, limits=limits)
        self._pose = np.array(pose, dtype=float)
        first = self._predict(self._pose[None])
        reason = self._why_not(first)
        if reason:
            raise PlanningError(f"the rover cannot start at {tuple(pose)}: {reason}")
        self._here, self._before = first, first
        self._spin = np.zeros(6)
        self._wheel_rates = np.zeros(6)
        self._torques = np.zeros(6)
        self._speed, self._yaw_rate, self._duration = 0.0, 0.0, 1.0
        self._stopped = ""
        self._anchor, self._stalled = self._pose.copy(), 0.0

    def pose(self) -> Floats:
        """Return x, y [m] and yaw [rad] (3,) of the body origin."""
        return self._pose.copy()

    def drive(self, speed: float, yaw_rate: float, duration: float) -> None:
        """Drive at a speed [m/s] and yaw rate [rad/s] for a duration [s], if this is possible."""
        self._torques = self._here.torque[0].copy()
        self._move(speed, yaw_rate, duration)

    def pull(self, torques: Floats, yaw_rate: float, duration: float) -> None:
        """Apply torques (6,) [N m] for a duration [s]; `yaw_rate` [rad/s] sets the steering."""
        wheel, limit = self._rover.wheel, self._rover.wheel.max_torque
        self._torques = np.clip(torques, -limit, limit)
        forces = find_driving_forces(
            self._writer, wheel.radius, self._here, self._torques, float(np.sign(self._speed))
        )
        speed = self._speed + (forces.push / self._mass - DRAG * self._speed) * duration
        top = wheel.max_speed * wheel.radius
        speed = float(np.clip(speed, -top, top))
        if self._speed * speed < 0.0:
            speed = 0.0  # the rover stops before it reverses
        turning = yaw_rate if abs(speed) > CREEP else 0.0
        self._move(speed, turning, duration, forces)
        racing = np.sign(torques) * wheel.max_speed
        self._wheel_rates = np.where(forces.sliding, racing, self._wheel_rates)
        self._watch_stall(forces, duration)

    def _watch_stall(self, forces: DrivingForces, duration: float) -> None:
        """Set the reason for standing still when wheels slide or motors saturate for PATIENCE."""
        saturated = np.abs(self._torques) >= 0.999 * self._rover.wheel.max_torque
        moved = float(np.hypot(*(self._pose - self._anchor)[:2]))
        if moved > MIN_PROGRESS or not (forces.sliding.any() or saturated.any()):
            self._anchor, self._stalled = self._pose.copy(), 0.0
            return
        self._stalled += duration
        if self._stalled < PATIENCE or self._stopped:
            return
        if forces.sliding.any():
            self._stopped = f"wheels slip and the rover stays: {forces.name_sliding()}"
        else:
            self._stopped = "motors saturate and the rover stays"

    def _move(
        self, speed: float, yaw_rate: float, duration: float, forces: DrivingForces | None = None
    ) -> None:
        """Move if the model allows it.

        With `forces`, which already include friction and torque limits, these are not checked.
        """
        self._stopped = ""
        middle = self._pose[2] + 0.5 * yaw_rate * duration
        step = speed * duration
        way = np.array([step * np.cos(middle), step * np.sin(middle), yaw_rate * duration])
        there = self._pose + way
        moved = self._predict(np.vstack([self._pose, there]), forces is not None)
        reason = self._why_not(moved, forces is not None) if step or yaw_rate else ""
        if reason:
            self._stopped, self._speed, self._yaw_rate = reason, 0.0, 0.0
            self._before, self._duration = self._here, duration
            self._wheel_rates = np.zeros(6)
            return
        self._before, self._here = self._here, _last_row(moved)
        self._pose, self._speed, self._yaw_rate = there, speed, yaw_rate
        self._duration = duration
        ways = self._here.wheel_centres[0] - self._before.wheel_centres[0]
        ahead = np.array([np.cos(middle), np.sin(middle), 0.0])
        rolled = np.copysign(np.linalg.norm(ways, axis=1), ways @ ahead)
        turned = rolled / self._rover.wheel.radius
        turned /= 1.0 - np.clip(self._slip(forces), 0.0, MAX_SLIP)
        self._spin += turned
        self._wheel_rates = turned / duration

    def _slip(self, forces: DrivingForces | None) -> Floats:
        """Return the slip ratios (6,): of the model, or on firm ground of the forces."""
        here = self._here
        if forces is None or np.any(here.motion_resistance[0] > 0.0):
            return here.slip_ratio[0]
        return np.array([coulomb_slip(used) for used in forces.utilisation.tolist()])

    def _predict(self, poses: Floats, pulled: bool = False) -> PathPrediction:
        """Return the model's prediction at poses (n, 3); if `pulled`, with optimal torques."""
        policy = OPTIMAL if pulled else self._policy
        return sweep_path(
            self._rover,
            self._terrain,
            poses,
            SweepOptions(friction=self._friction, policy=policy, soil=self._soil),
        )

    def _why_not(self, prediction: PathPrediction, pulled: bool = False) -> str:
        """Return the reason why the last pose cannot be reached; empty if it can.

        If `pulled`, the driving forces decide about grip at a pose. Crossings of steep faces
        between poses are judged with optimal torques.
        """
        rover, between = self._rover, prediction.between
        at_end = prediction
        if pulled:
            rover = self._without_force_limits
            at_end = replace(prediction, wheel_loads=np.abs(prediction.wheel_loads))
        reason = find_reasons(rover, at_end)[1][-1]
        if not reason and between is not None and len(between.poses):
            _, on_the_way = find_reasons(self._rover, between)
            return next((reason for reason in on_the_way if reason), "")
        return reason

    def state(self) -> PlantState:
        """Return the current measurements."""
        here, before, duration = self._here, self._before, self._duration
        angles = _suspension(here)
        rates = (angles - _suspension(before)) / duration
        yaw = self._pose[2]
        roll, pitch = float(here.roll[0]), float(here.pitch[0])
        roll_rate = (roll - float(before.roll[0])) / duration
        pitch_rate = (pitch - float(before.pitch[0])) / duration
        climb = float(here.position[0, 2] - before.position[0, 2]) / duration
        names = (*SUSPENSION_JOINTS, *WHEEL_JOINTS)
        positions = np.concatenate([angles, self._spin])
        velocities = np.concatenate([rates, self._wheel_rates])
        return PlantState(
            position=here.position[0].copy(),
            orientation=xyzw_from_rpy(roll, pitch, yaw),
            velocity=np.array([np.hypot(self._speed, climb) * np.sign(self._speed), 0.0, 0.0]),
            body_rates=_body_rates(roll, pitch, roll_rate, pitch_rate, self._yaw_rate),
            joint_positions=dict(zip(names, positions.tolist(), strict=True)),
            joint_velocities=dict(zip(names, velocities.tolist(), strict=True)),
            wheel_torques=self._torques.copy(),
            stopped=self._stopped,
        )


def _last_row(prediction: PathPrediction) -> PathPrediction:
    """Return a prediction that has only the last waypoint."""
    n = len(prediction.poses)
    rows = {
        field.name: getattr(prediction, field.name)[-1:]
        for field in fields(prediction)
        if isinstance(getattr(prediction, field.name), np.ndarray)
        and len(getattr(prediction, field.name)) == n
    }
    return replace(prediction, **rows, between=None)


def _suspension(prediction: PathPrediction) -> Floats:
    """Return the angles of SUSPENSION_JOINTS (4,) [rad]."""
    return np.concatenate([prediction.rocker_angle[0], prediction.bogie_angle[0]])


def _body_rates(
    roll: float, pitch: float, roll_rate: float, pitch_rate: float, yaw_rate: float
) -> Floats:
    """Return the angular velocity (3,) [rad/s], body frame, from Euler angles [rad] and rates."""
    return np.array(
        [
            roll_rate - np.sin(pitch) * yaw_rate,
            np.cos(roll) * pitch_rate + np.sin(roll) * np.cos(pitch) * yaw_rate,
            -np.sin(roll) * pitch_rate + np.cos(roll) * np.cos(pitch) * yaw_rate,
        ]
    )
