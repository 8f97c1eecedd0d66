# SPDX-License-Identifier: Apache-2.0
"""Traverse services without ROS, for tests."""

from rover_physics import Terrain
from rover_planner.parameters.traverse_server import TraverseServerParameters
from rover_planner.planning.answering.service_settings import (
    ServiceSettings,
    load_service_settings,
)
from rover_planner.planning.answering.traverse_service import TraverseService


def load_settings(**parameters) -> ServiceSettings:
    """Return the settings of a service with some parameters."""
    return load_service_settings(TraverseServerParameters(**parameters))


def make_service(terrain: Terrain | None = None, **parameters) -> TraverseService:
    """Return a service with some parameters, and with a map if one is given."""
    service = TraverseService(load_settings(**parameters))
    if terrain is not None:
        service.take_terrain(terrain)
    return service
