# SPDX-License-Identifier: Apache-2.0
"""Settings of a traverse server: its parameters and the loaded rover."""

from dataclasses import dataclass, replace

from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.manipulator import body_mass_and_com
from rover_physics.rover.model import Rover
from rover_physics.rover.rover_file import load_rover
from rover_physics.rover.steering_joints import check_joint_limit
from rover_physics.terrain.soil_file import soil_named
from rover_planner.parameters.shared import payload_or_none
from rover_planner.parameters.traverse_server import (
    INTERPOLATE,
    USE,
    TraverseServerParameters,
)
from rover_planner.planning.learned_ground import LearnedGround
from rover_planner.planning.path_query import PathQueryOptions, assume
from rover_planner.planning.search.query import LatticeSettings

MONITOR_OFFSET = 5.0
"""Default of monitor_offset [wheel radii]."""


@dataclass(frozen=True)
class ServiceSettings:
    """The parameters of a traverse server, loaded and ready to use."""

    rover: Rover
    """The rover of all queries."""
    query: PathQueryOptions
    """Options of the generation and judgement of candidates."""
    lattice: LatticeSettings
    """Settings of searches around obstacles."""
    parameters: TraverseServerParameters
    """The parameters themselves."""
    told: float | None = None
    """Friction that was told, where a learned one is assumed; None: it is the rover's."""

    @property
    def largest_gap(self) -> float:
        """Widest unknown region of a map that is interpolated [m]; 0 interpolates none."""
        values = self.parameters
        return values.max_gap if values.unknown_cells == INTERPOLATE else 0.0

    @property
    def monitor_offset(self) -> float:
        """Distance from its path above which the rover is to stop [m]."""
        return self.parameters.monitor_offset or MONITOR_OFFSET * self.rover.wheel.radius

    def on_ground(self, ground: LearnedGround | None) -> "ServiceSettings":
        """Return the settings of new questions; with USE they assume the learned ground."""
        if ground is None or self.parameters.learn != USE:
            return self
        told = assume(self.rover, self.query.model).change(self.rover).friction
        rover = ground.change(replace(self.rover, friction=told))
        return replace(self, rover=rover, query=self.query.change(friction=None), told=told)

    @property
    def manipulator_joints(self) -> tuple[str, ...]:
        """Names of the manipulator's joints, () if the rover has no manipulator."""
        manipulator = self.rover.manipulator
        return tuple(manipulator.joints) if manipulator is not None else ()


def load_service_settings(parameters: TraverseServerParameters) -> ServiceSettings:
    """Load the rover named in the parameters, and check soil and payload.

    Raises:
        RoverError: The rover cannot be loaded, its steering joints do not reach its steering
            limit, the soil is not among the presets, or the rover cannot carry the payload.
        ParameterError: The payload is below 0 and not OWN_PAYLOAD.
    """
    rover, payload = load_rover(parameters.rover), payload_or_none(parameters.payload)
    if payload is not None:
        body_mass_and_com(rover, payload=payload)
    if parameters.steering_limit:
        check_joint_limit(rover, parameters.steering_limit)
    if parameters.soil:
        soil_named(parameters.soil)
    return ServiceSettings(
        rover=rover,
        query=PathQueryOptions(
            count=parameters.candidate_count,
            spacing=parameters.candidate_spacing,
            waypoint_spacing=parameters.waypoint_spacing,
            model=SweepOptions(
                policy=parameters.policy,
                control_margin=parameters.control_margin,
                friction=parameters.friction or None,
                max_torque=parameters.max_torque or None,
                soil=parameters.soil or None,
                payload=payload,
            ),
            map_sigmas=parameters.map_sigmas,
            accepted_chance=parameters.accepted_chance,
        ).fit(rover),
        lattice=LatticeSettings(
            budget=parameters.search_budget,
            cell=parameters.lattice_cell or None,
            frontier=parameters.search_frontier,
            chance_weight=parameters.chance_weight,
        ),
        parameters=parameters,
    )
