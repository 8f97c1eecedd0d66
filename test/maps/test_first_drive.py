# SPDX-License-Identifier: Apache-2.0
"""A rover whose camera sees ahead only starts from where it stands and reaches its goal."""

import math

import numpy as np

from rover_physics.names import SUSPENSION_JOINTS
from rover_physics.numerics.quaternions import rpy_from_xyzw
from rover_planner.maps.ground_beneath import Standing
from rover_planner.parameters.rover_simulator import RoverSimulatorParameters
from rover_planner.parameters.traverse_server import FAN, MERGE
from rover_planner.planning.answering.map_keeper import MapKeeper
from rover_planner.planning.answering.snapshot import GivenPath
from rover_planner.simulator.simulation import Simulation
from support.grounds import make_terrain, waves
from support.rovers import LSR1
from support.services import make_service

CAMERA = {"sensor_field_of_view": math.radians(60.0), "sensor_least_range": 0.5}
"""A camera that sees 60 degrees ahead, from 0.5 m on."""
START, GOAL = (-2.0, 0.0, 0.0), (0.5, 0.2, 0.0)
MARGIN = 0.2
"""Margin of the start footprint that reaches from the wheels to where the camera sees [m]."""


class Drive:
    """A simulated rover whose camera has looked once, and a server that knows no more."""

    def __init__(self, **parameters):
        simulated = RoverSimulatorParameters(start_x=START[0], speed=0.08, **CAMERA)
        self.simulation = Simulation(LSR1, make_terrain(waves), simulated)
        self.service = make_service(map_updates=MERGE, planner=FAN, **parameters)
        self.keeper = MapKeeper(LSR1, self.service.settings.parameters)
        self.time = 0.0
        self.look()

    def look(self) -> None:
        """Give the server the map that the camera sees now."""
        state = self.simulation.plant.state()
        attitude = rpy_from_xyzw(tuple(state.orientation.tolist()))
        suspension = np.array([state.joint_positions[name] for name in SUSPENSION_JOINTS])
        standing = Standing(np.array([*state.position, *attitude]), suspension)
        seen = self.simulation.look(state.position, attitude[2])
        now = self.keeper.take(seen, "elevation_cloud", self.time, standing)
        self.service.take_terrain(now.terrain, "elevation_cloud", None, now.sources)


def test_the_first_drive_is_accepted_and_reaches_its_goal():
    drive = Drive(footprint_margin=MARGIN)
    first = drive.service.snapshot().answer(START, GOAL)
    assert first.traversable, first.reason
    assert 0.1 < first.ground.footprint_share <= first.ground.unobserved_share < 0.5
    path = first.candidate.poses
    drive.simulation.take_path(path)
    while drive.simulation.follows_path:
        for _ in range(10):
            drive.time += 0.1
            assert not drive.simulation.advance(drive.time, 0.1).stopped
        assert drive.time < 200.0
        drive.look()
        # What was seen stays: the path is still passable where the camera does not look.
        drive.service.given_path = GivenPath(path, "")
        assert drive.service.given_path.judge(drive.service.snapshot()).traversable
    assert np.hypot(*(drive.simulation.plant.pose() - GOAL)[:2]) < 0.1
    names = drive.service.known_map.cells.count()
    assert names["elevation_cloud"] > 0 and names["footprint"] > 0 and names["contact"] > 0


def test_without_the_footprint_the_start_is_unknown_ground():
    for parameters in ({"fill_under_rover": False}, {"footprint_margin": 0.0}):
        drive = Drive(**parameters)
        assert drive.service.snapshot().answer(START, GOAL).code == "unknown_ground"


def test_blind_ground_is_refused_where_the_parameter_says_so():
    drive = Drive(footprint_margin=MARGIN, blind_ground="refuse")
    refused = drive.service.snapshot().answer(START, GOAL)
    assert refused.code == "blind_ground" and not refused.traversable
    report = refused.report
    assert "never seen" in refused.reason and report["first_failure"] == 0
    assert report["traversability_class"] == "passable"
    assert f"{100.0 * refused.ground.unobserved_share:.1f} %" in refused.reason
