# SPDX-License-Identifier: Apache-2.0
"""Assumptions of a prediction in a file, so that it can be judged again under the same."""

import json
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING

from rover_physics.bounds.path import SIGMAS
from rover_physics.errors import RoverError
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.model import Rover
from rover_planner.errors import PlanningError

if TYPE_CHECKING:
    from rover_planner.planning.path_query import PathQueryOptions


@dataclass(frozen=True)
class Assumptions:
    """Rover and options of a prediction, as a file keeps them; None is the rover's own value."""

    __pydantic_config__ = {"extra": "forbid", "strict": True, "allow_inf_nan": False}  # noqa: RUF012

    rover: str
    """Name of the rover."""
    policy: str
    """Torque policy."""
    control_margin: float = 0.0
    """Share of friction and torque left to the controller."""
    friction: float | None = None
    """Coulomb friction where the terrain has none."""
    max_torque: float | None = None
    """Largest wheel torque [N m]."""
    soil: str | None = None
    """Preset soil where the terrain names none; None: Coulomb friction."""
    payload: float | None = None
    """Mass at the arm's tip [kg]."""
    joint_angles: dict[str, float] | None = None
    """Arm angles [rad] by joint name; None is stowed."""
    has_tool_load: bool = False
    """True if a force or moment acted on the arm's tip."""
    map_sigmas: float = SIGMAS
    """Standard deviations that were allowed for."""

    def change(self, rover: Rover) -> Rover:
        """Return a rover with the values that were assumed in place of its own."""
        wheel, arm = rover.wheel, rover.manipulator
        if self.max_torque is not None:
            wheel = replace(wheel, max_torque=self.max_torque)
        if self.payload is not None and arm is not None:
            arm = replace(arm, payload=self.payload)
        friction = rover.friction if self.friction is None else self.friction
        return replace(rover, friction=friction, wheel=wheel, manipulator=arm)

    def change_options(self, options: "PathQueryOptions") -> "PathQueryOptions":
        """Return options with the policy, margin, soil and deviations that were assumed.

        Raises:
            RoverError: The policy or the margin is invalid.
        """
        return options.change(
            policy=self.policy,
            control_margin=self.control_margin,
            soil=self.soil,
            map_sigmas=self.map_sigmas,
        )


def assume(rover: Rover, options: SweepOptions, map_sigmas: float = SIGMAS) -> Assumptions:
    """Return the assumptions of a prediction."""
    told = ("policy", "control_margin", "friction", "max_torque", "soil", "payload")
    return Assumptions(
        rover=rover.name,
        **{name: getattr(options, name) for name in told},
        joint_angles=options.arm_angles,
        has_tool_load=options.tool_force is not None or options.tool_moment is not None,
        map_sigmas=map_sigmas,
    )


def write_assumptions(assumptions: Assumptions) -> str:
    """Return assumptions as JSON in one line."""
    return json.dumps(asdict(assumptions), separators=(",", ":"), ensure_ascii=False)


def read_assumptions(text: str) -> Assumptions:
    """Return the assumptions that `write_assumptions` has written.

    Raises:
        PlanningError: The text is something else.
    """
    from pydantic import TypeAdapter, ValidationError

    from rover_planner.planning.path_query import PathQueryOptions

    try:
        assumptions: Assumptions = TypeAdapter(Assumptions).validate_json(text)
        assumptions.change_options(PathQueryOptions())
    except (ValidationError, RoverError) as error:
        reason = str(error).splitlines()[0]
        raise PlanningError(f"assumptions are invalid: {reason}") from None
    return assumptions
