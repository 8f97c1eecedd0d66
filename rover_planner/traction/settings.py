# SPDX-License-Identifier: Apache-2.0
"""The settings of a traction controller: its parameters, with rover and defaults filled in."""

from dataclasses import dataclass

from rover_physics.rover.model import Rover
from rover_physics.rover.rover_file import load_rover
from rover_physics.rover.steering_joints import check_joint_limit
from rover_physics.traction.balance import BalanceWriter
from rover_planner.parameters.shared import payload_or_none
from rover_planner.parameters.traction_controller import TractionControllerParameters

TORQUE_RATE_RATIO = 0.25
"""Default of torque_rate over the rover's weight times the wheel radius [1/s]. Where torques jump,
as when a wheel meets a wall, wheels begin to slip and stick by turns."""


@dataclass(frozen=True)
class TractionSettings:
    """The parameters of a traction controller and its rover."""

    rover: Rover
    """The rover that is driven."""
    parameters: TractionControllerParameters
    """The parameters; where 0 stands for the rover's own value, the properties below have it."""

    @property
    def friction(self) -> float:
        """Assumed friction coefficient."""
        return self.parameters.friction or self.rover.friction

    @property
    def max_torque(self) -> float:
        """Largest torque of a wheel [N m]."""
        return self.parameters.max_torque or self.rover.wheel.max_torque

    @property
    def payload(self) -> float | None:
        """Mass at the arm's tip [kg]; None takes that of the rover."""
        return payload_or_none(self.parameters.payload)

    @property
    def slip_gain(self) -> float:
        """Torque per difference between wheel rate and rolling rate [N m s/rad]."""
        return self.parameters.slip_gain * self.rover.weight * self.rover.wheel.radius**2

    @property
    def torque_rate(self) -> float:
        """Largest rate of change of a torque [N m/s]."""
        full_pull = self.rover.weight * self.rover.wheel.radius
        return self.parameters.torque_rate or TORQUE_RATE_RATIO * full_pull


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
    settings = TractionSettings(rover, parameters)
    BalanceWriter(rover, settings.payload)
    return settings
