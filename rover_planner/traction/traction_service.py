"""What a traction controller knows and decides, without ROS: measurements in, torques out."""

import time
from collections.abc import Mapping
from dataclasses import dataclass
from statistics import median
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_physics.errors import ModelError
from rover_physics.names import SUSPENSION_JOINTS, WHEEL_JOINTS
from rover_physics.rover.model import Rover
from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traction.balance import BalanceRows, BalanceWriter, MeasuredState
from rover_physics.traction.contact_ekf import (
    ContactEstimate,
    Motion,
    MotionContactEstimator,
    level_estimate,
)
from rover_physics.traction.map_contacts import MapContactFinder
from rover_physics.traction.solver import TractionAnswer, TractionWorkspace, solve_traction
from rover_planner.ros.map_intake import PreparedMap, prepare_map
from rover_planner.traction.input_monitor import InputMonitor
from rover_planner.traction.loops import (
    LoopGains,
    PIController,
    StallDetector,
    limit_rate,
    rolling_rates,
)

Floats = NDArray[np.float64]
INPUTS = ("joint_states", "imu", "cmd_vel")
ODOMETRY = "odometry"
OWN_PAYLOAD = -1.0
"""Value of the parameter payload that takes what the rover file has."""
EQUAL, OPTIMAL = "equal", "optimal"
MAX_PUSH = 0.6
"""Largest push of the speed loop, in weights."""
SERVO_STIFFNESS = 6.0
"""Gain of the servos that take over where the rover does not get on, in gains against slip."""
MAX_STEP = 0.1
"""Longest time between two updates that loops and filter count [s]."""


@dataclass(frozen=True)
class TractionSettings:
    """The parameters of a traction controller, loaded and ready to use."""

    rover: Rover
    """The rover that is driven."""
    friction: float
    """Friction coefficient that is counted on."""
    max_torque: float
    """Largest torque of a wheel [N m]."""
    payload: float | None
    """Mass at the arm's tip [kg], None for the rover's own."""
    policy: str
    """EQUAL or OPTIMAL."""
    timeout: float
    """Age from which an input is stale [s]."""
    odometry_timeout: float
    """The same for odometry [s]."""
    gains: LoopGains
    """Of the loops."""


@dataclass(frozen=True, eq=False)
class TractionUpdate:
    """What one update made of the measurements."""

    torques: Floats
    """(6,) torques to command, wheel order [N m]; zero where there is a fault."""
    fault: str
    """Why there are none, empty where nothing is wrong."""
    warning: str
    """What is amiss though the rover drives, empty where nothing is."""
    answer: TractionAnswer | None
    """The shared torques, before heading and slip; None where there is a fault."""
    estimate: ContactEstimate | None
    """Where the wheels touch; None where there is a fault."""
    duration: float
    """How long it took [s]."""


def settings_from_parameters(values: Mapping[str, Any]) -> TractionSettings:
    """Load what the parameters of the traction controller name.

    Args:
        values: All of the table `TRACTION_CONTROLLER`, each already checked.

    Raises:
        RoverError: The rover cannot be loaded, or the payload is none for this rover.
    """
    rover, payload = load_rover(values["rover"]), values["payload"]
    settings = TractionSettings(
        rover=rover,
        friction=values["friction"] or rover.friction,
        max_torque=values["max_torque"] or rover.wheel.max_torque,
        payload=None if payload == OWN_PAYLOAD else payload,
        policy=values["policy"],
        timeout=values["timeout"],
        odometry_timeout=values["odometry_timeout"],
        gains=LoopGains(
            speed=values["speed_gain"],
            travel=values["travel_gain"],
            heading=values["heading_gain"],
            slip=values["slip_gain"] * rover.weight * rover.wheel.radius**2,
            torque_rate=values["torque_rate"],
        ),
    )
    BalanceWriter(rover, settings.payload)
    return settings


class TractionService:
    """The last measurements, the estimate of where wheels touch, and the loops."""

    def __init__(self, settings: TractionSettings):
        self._workspace = TractionWorkspace()
        self._watch = InputMonitor(INPUTS, settings.timeout)
        self._odometry_watch = InputMonitor((ODOMETRY,), settings.odometry_timeout)
        self._positions = np.zeros(len(SUSPENSION_JOINTS))
        self._rates: Floats | None = None
        self._wheel_rates = np.zeros(len(WHEEL_JOINTS))
        self._mean_rate = 0.0
        self._attitude = (0.0, 0.0)
        self._body_rates: Floats | None = None
        self._wanted = (0.0, 0.0)
        self._pose, self._deviation = np.zeros(4), 0.0
        self._terrain: Terrain | None = None
        self._last_time: float | None = None
        self._finder: MapContactFinder | None = None
        self.settings = settings

    @property
    def settings(self) -> TractionSettings:
        """The settings in force."""
        return self._settings

    @settings.setter
    def settings(self, settings: TractionSettings) -> None:
        self._settings = settings
        rover, gains = settings.rover, settings.gains
        self._watch.timeout = settings.timeout
        self._odometry_watch.timeout = settings.odometry_timeout
        self._writer = BalanceWriter(rover, settings.payload)
        self._estimator = MotionContactEstimator(rover)
        self._friction = np.full(len(WHEEL_JOINTS), settings.friction)
        weight = self._writer.weight
        mass = weight / rover.gravity
        self._arm = rover.suspension.wheels["middle"][1]
        most = MAX_PUSH * weight
        self._speed = PIController(mass * gains.speed, mass * gains.travel, most)
        inertia = mass * self._arm**2
        heading = inertia * gains.heading
        self._heading = PIController(heading, 0.5 * heading, most * self._arm)
        if self._terrain is not None:
            self.take_terrain(self._terrain)
        self._let_go()

    @property
    def watch(self) -> InputMonitor:
        """Which inputs are there and fresh."""
        return self._watch

    def take_joints(
        self, positions: Mapping[str, float], velocities: Mapping[str, float], now: float
    ) -> None:
        """Take the angles [rad] and rates [rad/s] of joints by name, at a time [s]."""
        missing = [name for name in SUSPENSION_JOINTS if name not in positions]
        missing += [name for name in WHEEL_JOINTS if name not in velocities]
        if missing:
            what = "position" if missing[0] in SUSPENSION_JOINTS else "velocity"
            self._watch.refuse(
                "joint_states", f"joint_states has no {what} of {', '.join(missing)}"
            )
            return
        self._positions = np.array([positions[name] for name in SUSPENSION_JOINTS])
        self._wheel_rates = np.array([velocities[name] for name in WHEEL_JOINTS])
        self._mean_rate = float(self._wheel_rates.sum()) / len(WHEEL_JOINTS)
        known = all(name in velocities for name in SUSPENSION_JOINTS)
        self._rates = np.array([velocities[name] for name in SUSPENSION_JOINTS]) if known else None
        self._watch.take("joint_states", now)

    def take_attitude(self, roll: float, pitch: float, rates: Floats | None, now: float) -> None:
        """Take roll and pitch [rad] and, where measured, angular velocity (3,) [rad/s]."""
        self._attitude, self._body_rates = (roll, pitch), rates
        self._watch.take("imu", now)

    def take_command(self, speed: float, yaw_rate: float, now: float) -> None:
        """Take the wanted speed [m/s] and yaw rate [rad/s]."""
        self._wanted = (speed, yaw_rate)
        self._watch.take("cmd_vel", now)

    def take_odometry(self, pose: Floats, deviation: float, now: float) -> None:
        """Take (4,) x, y, z [m] and yaw [rad] in the map frame, and how well x, y are known."""
        self._pose, self._deviation = pose, deviation
        self._odometry_watch.take(ODOMETRY, now)

    def take_terrain(self, terrain: Terrain) -> None:
        """Take a map; it is used while odometry comes."""
        self.take_map(prepare_map(self._settings.rover, terrain))

    def take_map(self, prepared: PreparedMap) -> None:
        """Take a map that was made ready before; anew if it was for another rover."""
        rover = self._settings.rover
        if prepared.rover is not rover:
            prepared = prepare_map(rover, prepared.terrain)
        self._terrain, self._finder = prepared.terrain, prepared.finder

    def refuse(self, name: str, error: str) -> None:
        """Note that an input came that cannot be used."""
        (self._odometry_watch if name == ODOMETRY else self._watch).refuse(name, error)

    def update(self, now: float) -> TractionUpdate:
        """Return the torques for now [s], by the clock of the inputs."""
        start = time.perf_counter()
        fault = self._watch.find_fault(now)
        if fault:
            return self.rest(fault, start)
        duration = 0.0 if self._last_time is None else min(now - self._last_time, MAX_STEP)
        self._last_time = now
        estimate, warning = self._estimate_contacts(now, duration)
        state = self._measured_state(estimate)
        push = self._push(duration)
        try:
            rows = self._writer.write(state, push)
        except ModelError as error:
            rows, warning = self._writer.write(self._level_state(), push), str(error)
        answer = self._share(rows)
        torques = self._finish(answer, rows, duration)
        if not np.isfinite(torques).all():
            return self.rest(
                f"torques {torques.tolist()} N m came out; they must be finite", start
            )
        return TractionUpdate(torques, "", warning, answer, estimate, time.perf_counter() - start)

    def rest(self, fault: str, start: float | None = None) -> TractionUpdate:
        """Return zero torques at once, and forget what the loops have added up."""
        self._let_go()
        start = time.perf_counter() if start is None else start
        zero = np.zeros(len(WHEEL_JOINTS))
        return TractionUpdate(zero, fault, "", None, None, time.perf_counter() - start)

    def _let_go(self) -> None:
        self._speed.reset()
        self._heading.reset()
        self._stall = StallDetector()
        self._last_time = None
        self._last: Floats | None = None
        self._limited = False
        self._torques = np.zeros(len(WHEEL_JOINTS))

    def _estimate_contacts(self, now: float, duration: float) -> tuple[ContactEstimate, str]:
        """Return the contact angles from the best source there is, and what is amiss."""
        moving, warning = self._estimate_from_motion(duration)
        if self._finder is None or not self._odometry_watch.is_fresh(ODOMETRY, now):
            return moving, warning
        try:
            forward = self._wanted[0] >= 0.0
            state = self._measured_state(moving)
            return self._finder.find(state, self._pose, self._deviation, forward), ""
        except ModelError as error:
            return moving, warning or str(error)

    def _estimate_from_motion(self, duration: float) -> tuple[ContactEstimate, str]:
        if self._rates is None or self._body_rates is None:
            lacking = "joint_states has no velocities of the suspension"
            if self._rates is not None:
                lacking = "imu has no angular velocity"
            return level_estimate(), f"contact angles are taken as zero: {lacking}"
        rocker = 0.5 * (self._rates[0] - self._rates[1])
        state = self._level_state()
        motion = Motion(
            state.roll, state.pitch, state.rocker_angle, state.bogie_angles,
            rocker, self._rates[2:], self._wheel_rates, self._body_rates,
        )  # fmt: skip
        return self._estimator.update(motion, duration), ""

    def _level_state(self) -> MeasuredState:
        """Return the measured state with zero contact angles."""
        roll, pitch = self._attitude
        right, left, *bogies = self._positions
        angles = np.zeros(len(WHEEL_JOINTS))
        return MeasuredState(roll, pitch, 0.5 * (right - left), np.array(bogies), angles)

    def _measured_state(self, estimate: ContactEstimate) -> MeasuredState:
        state = self._level_state()
        state.contact_angles[:] = estimate.angles
        return state

    def _push(self, duration: float) -> float:
        """Return the wanted net traction [N] by the mean travel of the wheels."""
        speed = self._mean_rate * self._settings.rover.wheel.radius
        return self._speed.update(self._wanted[0] - speed, duration, self._limited)

    def _share(self, rows: BalanceRows) -> TractionAnswer:
        settings = self._settings
        answer = solve_traction(
            self._workspace, rows, self._friction, settings.max_torque,
            settings.rover.wheel.radius, self._last,
            max_programs=2 if settings.policy == OPTIMAL else 0,
        )  # fmt: skip
        self._last = answer.tractions
        self._limited = answer.torque_slack > 0.0 or answer.friction_slack > 0.0
        return answer

    def _finish(self, answer: TractionAnswer, rows: BalanceRows, duration: float) -> Floats:
        """Return the torques with what heading and slip ask for, limited in size and rate."""
        settings = self._settings
        gains, torques = settings.gains, answer.torques.copy()
        if self._body_rates is not None:
            error = self._wanted[1] - float(self._body_rates[2])
            moment = self._heading.update(error, duration, self._limited)
            torques += settings.rover.wheel.radius * moment / (6.0 * self._arm) * TURNING
        if settings.policy == OPTIMAL:
            wanted = self._wanted[0] / settings.rover.wheel.radius
            rolling = rolling_rates(self._wheel_rates, rows.wheel_speeds, wanted)
            torques -= gains.slip * (self._wheel_rates - rolling)
            # Wheels that spin turn faster than the rover goes: the median is nearer to that.
            share = self._stall.update(median(self._wheel_rates.tolist()), wanted, duration)
            if share > 0.0:
                servo = gains.slip * SERVO_STIFFNESS * (wanted - self._wheel_rates)
                torques += share * (servo - torques)
        torques = np.minimum(np.maximum(torques, -settings.max_torque), settings.max_torque)
        self._torques = limit_rate(torques, self._torques, gains.torque_rate * duration)
        return self._torques


TURNING = np.repeat([1.0, -1.0], 3)
"""Which way wheels drive to turn left: the right ones forwards."""
