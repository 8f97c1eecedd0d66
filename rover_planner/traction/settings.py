# SPDX-License-Identifier: Apache-2.0
"""The settings of a traction controller: its parameters, loaded and ready to use."""

from dataclasses import dataclass

from rover_physics.rover.model import Rover
from rover_physics.rover.rover_file import load_rover
from rover_physics.rover.steering_joints import check_joint_limit
from rover_physics.traction.balance import BalanceWriter
from rover_planner.parameters.shared import payload_or_none
from rover_planner.parameters.traction_controller import HOLD, TractionControllerParameters
from rover_planner.traction.loops import LoopGains

TORQUE_RATE_RATIO = 10.0
"""Default of torque_rate over the rover's largest torque [1/s]."""


@dataclass(frozen=True)
class InputTimeouts:
    """Ages above which inputs are stale [s]."""

    joint_states: float
    """Of the value of a wheel or suspension joint; stale is a fault."""
    imu: float
    """Of the attitude; stale is a fault."""
    cmd_vel: float
    """Of the commanded speeds; stale is a fault."""
    odometry: float
    """Of the pose; if it is stale, the map is not used."""


@dataclass(frozen=True)
class TractionSettings:
    """The parameters of a traction controller, loaded and ready to use."""

    rover: Rover
    """The rover that is driven."""
    friction: float
    """Assumed friction coefficient."""
    max_torque: float
    """Largest torque of a wheel [N m]."""
    payload: float | None
    """Mass at the arm's tip [kg]; None takes that of the rover."""
    policy: str
    """One of CONTROL_POLICIES."""
    timeouts: InputTimeouts
    """Ages above which inputs are stale."""
    gains: LoopGains
    """Gains of the loops."""
    rest_policy: str = HOLD
    """One of REST_POLICIES."""
    stall_time: float = 10.0
    """Time without progress after which the rover is stalled [s]."""


def load_traction_settings(
    parameters: TractionControllerParameters, last: TractionSettings | None = None
) -> TractionSettings:
    """Load the rover named in the parameters, and check the payload.

    Args:
        parameters: The parameters.
        last: Settings in force; an unchanged rover is taken from them, so that what was prepared
            for it stays valid.

    Raises:
        RoverError: The rover cannot be loaded, its steering joints do not reach its steering
            limit, or it cannot carry the payload.
        ParameterError: The payload is below 0 and not OWN_PAYLOAD.
    """
    rover = load_rover(parameters.rover)
    if parameters.steering_limit:
        check_joint_limit(rover, parameters.steering_limit)
    if last is not None and last.rover == rover:
        rover = last.rover
    settings = TractionSettings(
        rover=rover,
        friction=parameters.friction or rover.friction,
        max_torque=parameters.max_torque or rover.wheel.max_torque,
        payload=payload_or_none(parameters.payload),
        policy=parameters.policy,
        timeouts=InputTimeouts(
            joint_states=parameters.joint_states_timeout,
            imu=parameters.imu_timeout,
            cmd_vel=parameters.cmd_vel_timeout,
            odometry=parameters.odometry_timeout,
        ),
        gains=LoopGains(
            speed=parameters.speed_gain,
            travel=parameters.travel_gain,
            heading=parameters.heading_gain,
            slip=parameters.slip_gain * rover.weight * rover.wheel.radius**2,
            torque_rate=parameters.torque_rate or TORQUE_RATE_RATIO * rover.wheel.max_torque,
        ),
        rest_policy=parameters.rest_policy,
        stall_time=parameters.stall_time,
    )
    BalanceWriter(rover, settings.payload)
    return settings
