# SPDX-License-Identifier: Apache-2.0
"""The plant that simulates a quasi-static rover: it moves from one equilibrium to the next.

With a commanded speed, the rover moves if the model allows it; otherwise it stops with the model's
reason. With commanded torques, the balance of forces decides: the traction beyond the force that
holds the rover on its slope accelerates its mass, and wheel force beyond friction is lost as slip.
The mean speed of the wheels is the only state with inertia. Limits of attitude, suspension and
clearance apply in both cases. A brake locks the wheels. Wheels that steer turn at the rate of the
rover file; `SteeredDrive` says how the drive waits for them.
"""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from rover_physics.forces.soil import coulomb_slip
from rover_physics.names import EQUAL, OPTIMAL, SUSPENSION_JOINTS, WHEEL_JOINTS, WHEELS
from rover_physics.numerics.arrays import Floats
from rover_physics.prediction.packed_model import pack_model
from rover_physics.prediction.sweep import predict_steered
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.results.uses import find_uses, limits_of
from rover_physics.rover.model import Rover
from rover_physics.rover.steered_drive import SteeredDrive, WheelAims
from rover_physics.rover.steering_joints import steered_wheels, steering_joints
from rover_physics.terrain.grid import Terrain
from rover_physics.traction.balance import BalanceWriter
from rover_physics.traction.wheel_course import WheelCourse
from rover_physics.traversability.verdict import explain_rows
from rover_planner.errors import PlanningError
from rover_planner.simulator.driving_forces import (
    DrivingForces,
    find_driving_forces,
    measure_state,
)
from rover_planner.simulator.plant import PlantState

DRAG = 0.5
"""Damping of the speed by the gears: deceleration over speed [1/s]."""
MAX_SLIP = 0.95
"""Largest slip ratio that is used for wheel rates, which would be infinite at 1."""
CREEP = 1e-4
"""Speed below which the rover does not steer [m/s]."""
HELD = 1e-5
"""Speed below which the gears hold the rover [m/s]; else it would creep for ever."""
MIN_PROGRESS, PATIENCE = 1.0 / 3.0, 2.0
"""A rover that moves less than MIN_PROGRESS of its way at nominal speed within PATIENCE [s] counts
as stuck."""


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
        self._options = SweepOptions(friction=friction, policy=policy, soil=soil)
        self._writer = BalanceWriter(rover)
        self._mass = self._writer.weight / rover.gravity
        self._drive, self._course = SteeredDrive(rover), WheelCourse(rover)
        self._steered, self._steering_joints = steered_wheels(rover), steering_joints(rover)
        self._angles = np.zeros(6)
        self._motion = np.array([rover.nominal_speed, 0.0, 0.0])
        self._pose = np.array(pose, dtype=float)
        first = self._predict(self._pose[None], self._angles)
        reason = self._why_not(first)
        if reason:
            raise PlanningError(f"the rover cannot start at {tuple(pose)}: {reason}")
        self._here, self._before = first, first
        self._spin = np.zeros(6)
        self._wheel_rates = np.zeros(6)
        self._torques = np.zeros(6)
        self._speed, self._moved, self._duration = 0.0, np.zeros(3), 1.0
        self._stopped = ""
        self._last_step: tuple[object, ...] = ()
        self._forces: DrivingForces | None = None
        self._measured: PlantState | None = None
        self._anchor, self._stalled = self._pose.copy(), 0.0

    def pose(self) -> Floats:
        """Return x, y [m] and yaw [rad] (3,) of the body origin."""
        return self._pose.copy()

    def drive(self, speed: float, yaw_rate: float, duration: float) -> None:
        """Drive at a speed [m/s] and yaw rate [rad/s] for a duration [s], if this is possible.

        Wheels that steer turn at their largest rate, and the rover drives slower or stands until
        they point along the motion.
        """
        speed, yaw_rate = self._drive.clip(speed, yaw_rate)
        if self._repeats("drive", speed, yaw_rate):
            return
        self._torques = self._here.torque[0].copy()
        angles, aims = self._steer((speed, yaw_rate), duration)
        if aims.refusal:
            self._stopped = aims.refusal
            self._stand(duration)
            return
        share = self._drive.share(angles, aims.angles)
        self._speed = share * speed
        self._move(share * np.array([speed, 0.0, yaw_rate]), angles, duration)

    def _repeats(self, *step: object) -> bool:
        """Return whether this is the last step again, which began and ended at rest.

        Such a step changes nothing.
        """
        rests = self._before is self._here
        repeats = rests and self._last_step == (*step, True)
        self._last_step = *step, rests
        if not repeats:
            self._measured = None
        return repeats

    def _steer(self, command: tuple[float, float], duration: float) -> tuple[Floats, WheelAims]:
        """Return the steering angles (6,) [rad] after a duration [s], and the aims of a command.

        A rover that is to stand keeps its angles.
        """
        if not any(command):
            return self._angles, WheelAims(self._angles, np.zeros(6), "")
        aims = self._drive.aim(*command)
        return self._drive.turn(self._angles, aims.angles, duration), aims

    def pull(self, torques: Floats, command: tuple[float, float], duration: float) -> None:
        """Apply torques (6,) [N m] for a duration [s]; speed and yaw rate set the steering."""
        command = self._drive.clip(*command)
        if self._repeats("pull", *torques.tolist(), *command):
            self._watch_stall(duration)
            return
        wheel, limit = self._rover.wheel, self._rover.wheel.max_torque
        self._torques = np.clip(torques, -limit, limit)
        angles, aims = self._steer(command, duration)
        same = self._take_course()
        if not same:
            self._last_step = ()  # the next step is the first of this course
        forces = self._find_forces(self._torques, float(np.sign(self._speed)))
        speed = self._accelerate(forces, DRAG, duration)
        top = wheel.max_speed * wheel.radius
        speed = float(np.clip(speed, -top, top))
        if not same or self._drive.share(angles, aims.angles) == 0.0:
            speed = 0.0  # wheels that steer far away from the motion hold the rover
        self._speed = speed
        motion = speed * self._course.sign * self._rolling.motion
        if self._rover.steering is None and abs(speed) > CREEP:
            motion[2] = command[1]
        self._move(motion, angles, duration, forces)
        racing = np.sign(torques) * wheel.max_speed
        self._wheel_rates = np.where(forces.sliding, racing, self._wheel_rates)
        self._forces = forces
        self._watch_stall(duration)

    def brake(self, duration: float) -> None:
        """Lock the wheels for a duration [s]; beyond their friction the rover slides."""
        if self._repeats("brake"):
            return
        self._torques = np.zeros(6)
        self._take_course()
        direction = float(np.sign(self._speed))
        direction = direction or self._course.sign * float(
            np.sign(self._find_forces(self._torques, direction).push)
        )
        locked = -direction * self._course.sign * self._rolling.directions * self._writer.weight
        forces = self._find_forces(locked * self._rover.wheel.radius, direction)
        speed = self._accelerate(forces, 0.0, duration)
        self._speed = speed if speed * direction > 0.0 else 0.0
        spin = self._spin.copy()
        motion = self._speed * self._course.sign * self._rolling.motion
        self._move(motion, self._angles, duration, forces)
        self._spin, self._wheel_rates = spin, np.zeros(6)

    def _find_forces(self, torques: Floats, direction: float) -> DrivingForces:
        """Return the forces under torques (6,) [N m] of a rover that moves along its speed.

        `direction` is 1 for a rover that moves, -1 for one that moves back, 0 for one that stands.
        """
        radius, direction = self._rover.wheel.radius, self._course.sign * direction
        return find_driving_forces(self._writer, radius, self._here, torques, direction)

    def _accelerate(self, forces: DrivingForces, drag: float, duration: float) -> float:
        """Return the speed [m/s] after a duration [s]; the rover stops before it reverses."""
        push = self._course.sign * forces.push / self._rolling.inertia
        speed = self._speed + (push / self._mass - drag * self._speed) * duration
        return speed if self._speed * speed >= 0.0 and abs(speed) >= HELD else 0.0

    def _take_course(self) -> bool:
        """Note how the wheels roll; return False if this is another motion than before."""
        state = measure_state(self._here, self._writer.linkages[0])
        self._rolling = self._writer.find_rolling(state)
        return self._course.take(self._rolling, self._angles)

    def _watch_stall(self, duration: float) -> None:
        """Set the reason for standing still when wheels slide or motors saturate for PATIENCE."""
        forces = self._forces
        assert forces is not None
        saturated = np.abs(self._torques) >= 0.999 * self._rover.wheel.max_torque
        moved = float(np.hypot(*(self._pose - self._anchor)[:2]))
        least = MIN_PROGRESS * self._rover.nominal_speed * PATIENCE
        if moved > least or not (forces.sliding.any() or saturated.any()):
            self._anchor, self._stalled = self._pose.copy(), 0.0
            return
        self._stalled += duration
        if self._stalled < PATIENCE or self._stopped:
            return
        if forces.sliding.any():
            slipping = ", ".join(np.array(WHEELS)[forces.sliding])
            self._stopped = f"wheels slip and the rover stays: {slipping}"
        else:
            self._stopped = "motors saturate and the rover stays"

    def _move(
        self, motion: Floats, angles: Floats, duration: float, forces: DrivingForces | None = None
    ) -> None:
        """Move if the model allows it.

        With `forces`, which already include friction and torque limits, these are not checked.

        Args:
            motion: (3,) speed ahead and to the left [m/s] and yaw rate [rad/s].
            angles: (6,) steering angles [rad].
            duration: Duration [s].
            forces: The forces under given torques.
        """
        self._stopped = ""
        moves = bool(motion.any())
        if not moves and np.array_equal(angles, self._angles):
            self._stand(duration)
            return
        middle = self._pose[2] + 0.5 * motion[2] * duration
        c, s = np.cos(middle), np.sin(middle)
        step = duration * np.array(
            [c * motion[0] - s * motion[1], s * motion[0] + c * motion[1], motion[2]]
        )
        there = self._pose + step
        self._motion = motion if moves else self._motion
        pulled = forces is not None
        moved = self._predict(np.vstack([self._pose, there]), angles, pulled)
        reason = self._why_not(moved, pulled)
        if reason:
            self._stopped = reason
            self._stand(duration)
            return
        self._before, self._here = self._here, moved.select(slice(-1, None))
        self._pose, self._moved, self._angles = there, motion, angles
        self._duration = duration
        moved_by = self._here.wheel_centres[0] - self._before.wheel_centres[0]
        headings = middle + angles
        ahead = moved_by[:, 0] * np.cos(headings) + moved_by[:, 1] * np.sin(headings)
        rolled = np.copysign(np.hypot(ahead, moved_by[:, 2]), ahead)
        wheel = self._rover.wheel
        turned = rolled / wheel.radius
        turned /= 1.0 - np.clip(self._slip(forces), 0.0, MAX_SLIP)
        # No motor follows a wheel that drops off an edge within one step: it slides.
        most = wheel.max_speed * duration
        turned = np.clip(turned, -most, most)
        self._spin += turned
        self._wheel_rates = turned / duration

    def _stand(self, duration: float) -> None:
        """Stand still for a duration [s]."""
        self._speed, self._moved = 0.0, np.zeros(3)
        self._before, self._duration = self._here, duration
        self._wheel_rates = np.zeros(6)

    def _slip(self, forces: DrivingForces | None) -> Floats:
        """Return the slip ratios (6,): of the model, or on firm ground of the forces."""
        here = self._here
        if forces is None or np.any(here.motion_resistance[0] > 0.0):
            return here.slip_ratio[0]
        return np.array([coulomb_slip(used) for used in forces.utilisation.tolist()])

    def _predict(self, poses: Floats, angles: Floats, pulled: bool = False) -> PathPrediction:
        """Return the model's prediction at poses (n, 3); if `pulled`, with optimal torques."""
        options = replace(self._options, policy=OPTIMAL) if pulled else self._options
        model = pack_model(self._rover, self._terrain, options)
        return predict_steered(model, poses, self._motion, angles)

    def _why_not(self, prediction: PathPrediction, pulled: bool = False) -> str:
        """Return the reason why the last pose cannot be reached; empty if it can.

        If `pulled`, the driving forces decide about grip at a pose. Crossings of steep faces
        between poses are judged with optimal torques.
        """
        between, last = prediction.between, len(prediction.poses) - 1
        reasons = self._find_reasons(prediction, with_forces=not pulled)
        if last in reasons:
            return reasons[last]
        if between is None or not len(between.poses):
            return ""
        return next(iter(self._find_reasons(between, with_forces=True).values()), "")

    def _find_reasons(self, prediction: PathPrediction, with_forces: bool) -> dict[int, str]:
        """Return the reasons of the rows that break a limit, with or without those of forces."""
        limits = limits_of(self._rover, prediction.policy)
        uses = find_uses(limits if with_forces else limits.without_forces(), prediction.results)
        explained = explain_rows(self._rover, prediction, uses)
        return {row: reason for row, (_, reason) in explained.items()}

    def state(self) -> PlantState:
        """Return the current measurements; the same object while nothing has changed."""
        if self._measured is None or self._measured.stopped != self._stopped:
            self._measured = self._measure()
        return self._measured

    def _measure(self) -> PlantState:
        here, before, duration = self._here, self._before, self._duration
        angles = _suspension(here)
        rates = (angles - _suspension(before)) / duration
        ahead, aside, _ = self._moved
        turned = _orientation(before).inv() * _orientation(here)
        climb = float(here.position[0, 2] - before.position[0, 2]) / duration
        names = (*SUSPENSION_JOINTS, *WHEEL_JOINTS, *self._steering_joints)
        steering = here.steering_angle[0, self._steered]
        turning = (steering - before.steering_angle[0, self._steered]) / duration
        positions = np.concatenate([angles, self._spin, steering])
        velocities = np.concatenate([rates, self._wheel_rates, turning])
        return PlantState(
            position=here.position[0].copy(),
            orientation=_orientation(here).as_quat(),
            velocity=np.array([np.hypot(ahead, climb) * np.sign(ahead), aside, 0.0]),
            body_rates=turned.as_rotvec() / duration,
            joint_positions=dict(zip(names, positions.tolist(), strict=True)),
            joint_velocities=dict(zip(names, velocities.tolist(), strict=True)),
            wheel_torques=self._torques.copy(),
            stopped=self._stopped,
        )


def _suspension(prediction: PathPrediction) -> Floats:
    """Return the angles of SUSPENSION_JOINTS (4,) [rad]."""
    return np.concatenate([prediction.rocker_angle[0], prediction.bogie_angle[0]])


def _orientation(prediction: PathPrediction) -> Rotation:
    """Return the rotation of the body at a waypoint, body to map."""
    angles = prediction.poses[0, 2], prediction.pitch[0], prediction.roll[0]
    return Rotation.from_euler("ZYX", angles)
