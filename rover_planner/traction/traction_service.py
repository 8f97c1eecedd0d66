# SPDX-License-Identifier: Apache-2.0
"""The traction controller without ROS: keeps measurements and computes wheel torques."""

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from rover_physics.errors import ModelError
from rover_physics.names import OPTIMAL, WHEEL_COUNT
from rover_physics.numerics.arrays import Floats
from rover_physics.rover.steered_drive import SteeredDrive
from rover_physics.rover.steering_joints import steered_wheels
from rover_physics.terrain.grid import Terrain
from rover_physics.traction.balance import BalanceRows, BalanceWriter, MeasuredState
from rover_physics.traction.contact_ekf import (
    ContactEstimate,
    Motion,
    MotionContactEstimator,
    level_estimate,
)
from rover_physics.traction.map_contacts import MAP_SOURCE, MapContactFinder
from rover_physics.traction.program import ProgramInputs
from rover_physics.traction.solver import (
    MAX_PROGRAMS,
    TractionAnswer,
    TractionWorkspace,
    solve_traction,
)
from rover_physics.traction.wheel_course import WheelCourse
from rover_planner.parameters.shared import STOP
from rover_planner.traction.input_monitor import InputMonitor
from rover_planner.traction.joint_memory import MAX_TURNING_RATE, JointMemory
from rover_planner.traction.loops import (
    HEADING_INTEGRAL_GAIN,
    MAX_PUSH,
    STALLED_GROWTH,
    BodySpeed,
    PIController,
    PushLoop,
    SlipControl,
    StallDetector,
    WheelRates,
    limit_rate,
)
from rover_planner.traction.settings import TractionSettings

JOINT_STATES, IMU, CMD_VEL, ODOMETRY = "joint_states", "imu", "cmd_vel", "odometry"
MAX_STEP = 0.1
"""Upper bound of the time step of loops and filter [s]."""


DISABLED, EMERGENCY_STOP, FAULT = "disabled", "emergency_stop", "fault"
STALLED, STANDSTILL, DRIVING = "stalled", "standstill", "driving"
STATES = (DISABLED, EMERGENCY_STOP, FAULT, STALLED, STANDSTILL, DRIVING)
"""States of the rover; it drives in the last one only."""


@dataclass(frozen=True, eq=False)
class TractionCommand:
    """Torques of the wheels after one update, and how they were found."""

    torques: Floats
    """(6,) torques, wheel order [N m]."""
    fault: str = ""
    """Reason not to drive; empty if there is none."""
    warning: str = ""
    """Problem that does not stop the rover; empty if there is none."""
    answer: TractionAnswer | None = None
    """The torque allocation, before heading and slip control; None if the rover rests."""
    estimate: ContactEstimate | None = None
    """The contact angles; None if the rover rests."""
    duration: float = 0.0
    """Computation time of the allocation [s]; 0 if the rover rests."""
    state: str = DRIVING
    """One of STATES."""
    brake: bool = False
    """True if the brake is to be applied."""
    expiry: float = math.inf
    """Time at which the first input that the torques need becomes stale [s]."""


class TractionService:
    """Keeps the last measurements, the estimate of the contact angles, and the loops."""

    def __init__(self, settings: TractionSettings):
        """Start without measurements."""
        self._workspace = TractionWorkspace()
        self.monitor = InputMonitor({}, optional=(ODOMETRY,))
        """Times and errors of the inputs; odometry is never a fault."""
        self._finder: MapContactFinder | None = None
        self._begin(settings)

    def _begin(self, settings: TractionSettings) -> None:
        """Start with a rover, of which nothing is measured yet."""
        rover = settings.rover
        self.joints = JointMemory(rover)
        """Last measurements of the joints."""
        self.monitor.forget()
        self._steered, self.course = steered_wheels(rover), WheelCourse(rover)
        """Which wheels steer, and what is asked of them."""
        self.steering = np.zeros(WHEEL_COUNT)
        """Last measured steering angles (6,) [rad], positive to the left."""
        self._suspension_rates: Floats | None = None
        self.roll, self.pitch = 0.0, 0.0
        """Last measured attitude [rad], pitch positive with the nose down."""
        self._body_rates: Floats | None = None
        self.wanted = (0.0, 0.0)
        """Commanded speed [m/s] and yaw rate [rad/s], within what the rover can do."""
        self._pose, self._deviation = np.zeros(4), 0.0
        self._body_speed = BodySpeed()
        self._estimator = MotionContactEstimator(rover)
        self._apply(settings)
        self._reset()

    @property
    def settings(self) -> TractionSettings:
        """The current settings; new ones keep the torques and what the loops have added up.

        After another rover all inputs must arrive anew.
        """
        return self._settings

    @settings.setter
    def settings(self, settings: TractionSettings) -> None:
        if settings.rover is self._settings.rover:
            speed, heading = self._speed.integral, self._heading.integral
            self._apply(settings)
            self._speed.start(speed)
            self._heading.start(heading)
            return
        self._begin(settings)
        if self._finder is not None:
            self.take_map(self._finder)

    def _apply(self, settings: TractionSettings) -> None:
        """Take what follows from settings, and create the loops with their gains."""
        self._settings = settings
        rover, parameters = settings.rover, settings.parameters
        self._radius = rover.wheel.radius
        self.monitor.timeouts = {
            name: getattr(parameters, f"{name}_timeout")
            for name in (JOINT_STATES, IMU, CMD_VEL, ODOMETRY)
        } | {STOP: parameters.stop_timeout or math.inf}
        self.monitor.tolerance = parameters.stamp_tolerance
        self._writer, self._drive = BalanceWriter(rover, settings.payload), SteeredDrive(rover)
        self._optimal = parameters.policy == OPTIMAL
        friction = np.full(WHEEL_COUNT, settings.friction)
        self._inputs = ProgramInputs(friction, settings.max_torque, rover.wheel.radius)
        mass, max_push = self.weight / rover.gravity, MAX_PUSH * self.weight
        self._speed = PushLoop(
            mass * parameters.speed_gain, mass * parameters.travel_gain, max_push
        )
        half_track = rover.suspension.wheels["middle"][1]
        gain = half_track**2 * (mass * parameters.heading_gain)
        self._heading = PIController(gain, HEADING_INTEGRAL_GAIN * gain, max_push * half_track)
        self._slip = SlipControl(settings.slip_gain, settings.max_torque)

    def _reset(self) -> None:
        """Discard the last answer and set all integrals to zero."""
        self._speed.start()
        self._heading.start()
        self._slip.detector = StallDetector()
        self._last_time: float | None = None
        self._last: TractionAnswer | None = None
        self._limited, self._peak = False, 0.0
        self._torques = np.zeros(WHEEL_COUNT)

    @property
    def weight(self) -> float:
        """Weight with payload [N]."""
        return float(self._writer.weight)

    @property
    def terrain(self) -> Terrain | None:
        """The map; None before the first one."""
        return None if self._finder is None else self._finder.terrain

    @property
    def climbs(self) -> bool:
        """True if the suspension shows that the rover climbs, at the last update."""
        return self._slip.detector.climbs

    @property
    def wanted_rates(self) -> Floats:
        """Rates (6,) of the wheels that these ask for at the last steering angles [rad/s]."""
        return self.course.want(self.wanted, self.steering)[1] / self._radius

    def take_joints(
        self,
        positions: Mapping[str, float],
        velocities: Mapping[str, float],
        now: float,
        stamp: int = 0,
    ) -> None:
        """Take angles [rad] and rates [rad/s] of joints by name, measured at time `now` [s].

        A message may hold some of the joints only; each keeps its last value and time. `stamp` is
        the header stamp [ns], 0 if there is none; values whose stamp does not advance are old.
        """
        wrong = self.joints.find_wrong(positions, velocities)
        if wrong:
            self.monitor.refuse(JOINT_STATES, wrong, now)
            return
        if not self.joints.take(positions, velocities, now, stamp):
            if positions or velocities:
                self.monitor.ignore(JOINT_STATES, "stamps do not advance")
            return
        self.steering[self._steered] = self.joints.steering_angles
        earliest = now - self.monitor.timeouts[JOINT_STATES]
        self._suspension_rates = self.joints.find_suspension_rates(earliest)
        if math.isfinite(self.joints.time):
            self.monitor.take(JOINT_STATES, self.joints.time)

    def forget_times(self) -> None:
        """Forget when inputs came, after a step of the clock: each must arrive anew."""
        self.joints.forget()
        self.monitor.forget()

    def take_attitude(self, roll: float, pitch: float, rates: Floats | None, now: float) -> None:
        """Take roll and pitch [rad], measured at time `now` [s].

        `rates` is the angular velocity (3,) in the body frame [rad/s], None if not measured.
        """
        if rates is not None and not all(abs(one) <= MAX_TURNING_RATE for one in rates.tolist()):
            must = f"it must be within {MAX_TURNING_RATE:g} rad/s"
            self.monitor.refuse(IMU, f"imu has angular velocity {rates.tolist()}; {must}", now)
            return
        self.roll, self.pitch, self._body_rates = roll, pitch, rates
        self.monitor.take(IMU, now)

    def take_command(self, speed: float, yaw_rate: float, now: float) -> None:
        """Take the wanted speed [m/s] and yaw rate [rad/s], received at time `now` [s].

        Speeds beyond those of the rover's wheels are reduced.
        """
        self.wanted = self._drive.clip(speed, yaw_rate)
        self.monitor.take(CMD_VEL, now)

    def take_stop(self, stops: bool, now: float) -> None:
        """Take what the watch of the path says at time `now` [s]: whether the rover is to stop."""
        if stops:
            self.monitor.refuse(STOP, f"{STOP} is true: the watch stops the rover", now)
        else:
            self.monitor.take(STOP, now)

    def take_odometry(self, pose: Floats, deviation: float, now: float) -> None:
        """Take x, y, z [m], yaw [rad] (4,), map frame, and the standard deviation of x, y [m]."""
        self._pose, self._deviation = pose, deviation
        self._body_speed.take(pose[:2], now)
        self.monitor.take(ODOMETRY, now)

    def take_terrain(self, terrain: Terrain) -> None:
        """Take a map; it is used while odometry is recent."""
        self.take_map(MapContactFinder(self._settings.rover, terrain))

    def take_map(self, finder: MapContactFinder) -> None:
        """Take a prepared map; prepare it again if it is for another rover.

        Preparing takes longer than an update may. `ros/map_intake.py` does it in a thread.
        """
        rover = self._settings.rover
        is_own = finder.rover is rover
        self._finder = finder if is_own else MapContactFinder(rover, finder.terrain)

    def find_fault(self, now: float) -> str:
        """Return the fault of the inputs at time `now` [s]; empty if there is none."""
        older = ""
        if not self.monitor.is_fresh(JOINT_STATES, now):
            older = self.joints.describe_older(now - self.monitor.timeouts[JOINT_STATES])
        return self.monitor.find_fault(now, {JOINT_STATES: older})

    def start_from(self, torques: Floats) -> None:
        """Start to drive from torques (6,) [N m] that act now: the next ones are near them."""
        self._torques = torques.copy()

    def drive(self, now: float) -> TractionCommand:
        """Return the command for time `now` [s], at which the inputs have no fault."""
        start = time.perf_counter()
        duration = 0.0 if self._last_time is None else min(now - self._last_time, MAX_STEP)
        self._last_time = now
        level = self._measure_state(level_estimate())
        if not self.course.take(self._writer.find_rolling(level), self.steering):
            self._speed.start()
        estimate, warning = self._estimate_contacts(now, duration)
        state = self._measure_state(estimate)
        push = self._find_push(duration)
        try:
            if self._optimal:
                state = replace(state, loads=self._writer.find_loads(level))
            rows = self._write_rows(state, push)
        except ModelError as error:
            rows, warning = self._write_rows(level, push), str(error)
        warning = warning or self.course.describe_refusal(self.wanted)
        answer = self._share_torques(rows)
        self._from_map = estimate.source == MAP_SOURCE
        torques = self._command_torques(answer, rows, duration)
        if not np.isfinite(torques).all():
            return self.rest(f"torques {torques.tolist()} N m came out; they must be finite")
        took = time.perf_counter() - start
        return TractionCommand(
            torques, "", warning, answer, estimate, took, expiry=self.monitor.expiry
        )

    def rest(self, fault: str) -> TractionCommand:
        """Return zero torques at once, and reset the loops."""
        self._reset()
        return TractionCommand(np.zeros(WHEEL_COUNT), fault, state=FAULT)

    def _estimate_contacts(self, now: float, duration: float) -> tuple[ContactEstimate, str]:
        """Return the contact angles of the best source, and a warning, empty if none."""
        from_motion, warning = self._estimate_from_motion(duration)
        if self._finder is None or not self.monitor.is_fresh(ODOMETRY, now):
            return from_motion, warning
        try:
            backward = self._mean_wanted() < 0.0
            directions = -self.course.directions if backward else self.course.directions
            state = self._measure_state(from_motion)
            return self._finder.find(state, self._pose, self._deviation, directions), ""
        except ModelError as error:
            return from_motion, warning or str(error)

    def _estimate_from_motion(self, duration: float) -> tuple[ContactEstimate, str]:
        """Return the contact angles from motion; without rates, zero angles and a warning."""
        if self._suspension_rates is None or self._body_rates is None:
            lacking = "joint_states has no velocities of the suspension"
            if self._suspension_rates is not None:
                lacking = "imu has no angular velocity"
            return level_estimate(), f"contact angles are taken as zero: {lacking}"
        joints, rates = map(_mean_rocker, (self.joints.suspension_angles, self._suspension_rates))
        attitude = np.array([self.roll, self.pitch])
        motion = Motion(
            attitude, joints, rates, self.joints.wheel_rates, self._body_rates, self.steering
        )
        return self._estimator.update(motion, duration), ""

    def _measure_state(self, estimate: ContactEstimate) -> MeasuredState:
        """Return the measured state with estimated contact angles."""
        joints = _mean_rocker(self.joints.suspension_angles)
        return MeasuredState(
            self.roll, self.pitch, joints[0], joints[1:], estimate.angles, steering=self.steering
        )

    def _mean_wanted(self) -> float:
        """Return the wanted mean speed of the wheels [m/s]."""
        return self.course.want(self.wanted, self.steering)[0]

    def _find_progress(self) -> float:
        """Return the measured speed over the wanted one; 1 where it is not known, or not asked."""
        wanted, now = abs(self.wanted[0]), self._last_time
        if wanted == 0.0 or now is None or not self.monitor.is_fresh(ODOMETRY, now):
            return 1.0
        speed = self._body_speed.speed
        return speed / wanted if math.isfinite(speed) else 1.0

    def _find_push(self, duration: float) -> float:
        """Return the wanted push [N], from the mean travel of the wheels."""
        error = self._mean_wanted() - self.course.mean_of(self.joints.wheel_rates) * self._radius
        growth = STALLED_GROWTH * duration if self._slip.detector.stalled else duration
        if not self._optimal:
            return self._speed.update(error, growth, self._limited)
        return self._speed.push(error, growth, self._limited, self._peak)

    def _write_rows(self, state: MeasuredState, push: float) -> BalanceRows:
        """Return the balance with a push; the program takes it as resistance at the wheels."""
        push *= self.course.sign
        push, resistance = (0.0, push) if self._optimal else (push, 0.0)
        return self._writer.write(state, push, resistance)

    def _share_torques(self, rows: BalanceRows) -> TractionAnswer:
        """Return the torques of the policy, and record whether a limit is active."""
        last = self._last
        answer = solve_traction(
            self._workspace, rows, self._inputs, None if last is None else last.tractions,
            max_programs=MAX_PROGRAMS if self._optimal else 0,
        )  # fmt: skip
        self._last = answer
        self._peak = float(answer.utilisation.max())
        slips = not self._optimal and answer.friction_slack > 0.0
        self._limited = answer.torque_slack > 0.0 or slips
        return answer

    def _command_torques(
        self, answer: TractionAnswer, rows: BalanceRows, duration: float
    ) -> Floats:
        """Return the torques (6,) [N m] with the other loops, limited in magnitude and rate."""
        settings, torques, course = self._settings, answer.torques.copy(), self.course
        if self._body_rates is not None:
            mean_speed = course.mean_of(self.joints.wheel_rates) * self._radius
            wanted = course.yaw_rate(self.wanted[1], mean_speed)
            error = wanted - float(self._body_rates[2])
            moment = self._heading.update(error, duration, self._limited)
            torques += self._radius * moment * course.turning_shares
        if self._optimal:
            ahead = course.directions
            motion = WheelRates(
                ahead * self.joints.wheel_rates, course.sign * ahead * rows.wheel_speeds,
                self.joints.suspension_angles, self._mean_wanted() / self._radius, self._from_map,
                course.ratios, self._find_progress(),
            )  # fmt: skip
            torques = ahead * self._slip.correct(ahead * torques, motion, duration)
        torques = np.minimum(np.maximum(torques, -settings.max_torque), settings.max_torque)
        max_change = settings.torque_rate * duration
        self._torques = limit_rate(torques, self._torques, max_change)
        return self._torques


def _mean_rocker(values: Floats) -> Floats:
    """Return values (3,) of right rocker and bogies from those (4,) of SUSPENSION_JOINTS."""
    return np.array([0.5 * (values[0] - values[1]), values[2], values[3]])
