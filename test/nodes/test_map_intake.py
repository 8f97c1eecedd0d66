# SPDX-License-Identifier: Apache-2.0
"""Maps taken as bytes: each is prepared, the last again if need be, bad ones are refused."""

import threading
from types import SimpleNamespace

from rclpy.serialization import serialize_message

from msg_adapters.elevation import terrain_from_point_cloud, terrain_to_point_cloud
from rover_physics import Terrain
from rover_planner.parameters.traverse_server import TraverseServerParameters
from rover_planner.ros.frames import Frames
from rover_planner.ros.map_intake import MapIntake, are_gridded_alike
from support.grounds import plane
from support.waiting import wait_until

FRAMES = Frames(TraverseServerParameters(), lambda: 0)


def cloud_of(half):
    return serialize_message(terrain_to_point_cloud(plane(0.0, 0.0, half=half), "map"))


class Intake(MapIntake):
    """Keeps what is made of maps."""

    def __init__(self):
        self.errors: list[str] = []
        self.made: list[Terrain] = []
        logger = SimpleNamespace(error=self.errors.append)
        super().__init__(logger, FRAMES)

    def prepare(self, message, source):
        self.made.append(terrain_from_point_cloud(message))

    def wait_for(self, count):
        wait_until(lambda: len(self.made) == count, f"map {count}")


def test_each_map_is_prepared_and_the_last_again_where_a_parameter_changes():
    intake = Intake()
    intake.offer(cloud_of(1.0))
    intake.wait_for(1)
    intake.offer(cloud_of(2.0))
    intake.wait_for(2)
    first, second = (one.elevation.shape for one in intake.made)
    assert second > first
    before = TraverseServerParameters()
    assert are_gridded_alike(before, TraverseServerParameters(friction=0.5))
    assert not are_gridded_alike(before, TraverseServerParameters(map_resolution=0.2))
    intake.repeat()
    intake.wait_for(3)
    intake.close()
    assert len(intake.made) == 3


def test_a_map_that_comes_while_a_file_is_loaded_is_prepared_again_where_a_parameter_changes():
    intake, go_on = Intake(), threading.Event()
    intake.do(go_on.wait)
    intake.do(intake.forget)
    intake.offer(cloud_of(1.0))
    go_on.set()
    intake.repeat()
    intake.wait_for(2)
    intake.close()


def test_of_maps_that_wait_only_the_latest_is_prepared():
    intake, go_on = Intake(), threading.Event()
    intake.do(go_on.wait)
    for half in (1.0, 2.0, 3.0):
        intake.offer(cloud_of(half))
    go_on.set()
    intake.last_job.result()
    intake.close()
    assert [one.bounds[1] for one in intake.made] == [3.0]


def test_a_map_that_cannot_be_used_is_refused_and_the_last_is_prepared_again_and_the_next():
    intake = Intake()
    intake.offer(cloud_of(1.0))
    intake.wait_for(1)
    intake.offer(b"\x00\x01\x00\x00" + b"\xff" * 40)
    wait_until(lambda: intake.errors, "the refusal of damaged bytes")
    assert intake.errors[0].startswith("elevation_cloud refused, the last map stays: 44 bytes")
    intake.repeat()
    intake.wait_for(2)
    intake.offer(cloud_of(3.0))
    intake.wait_for(3)
    intake.close()
    assert [one.bounds[1] for one in intake.made] == [1.0, 1.0, 3.0]
