# SPDX-License-Identifier: Apache-2.0
"""Odometry and clouds of another frame are placed on the map."""

from functools import partial

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from nav_msgs.msg import Odometry
from rclpy.parameter import Parameter
from sensor_msgs.msg import PointCloud2

from msg_adapters.elevation import terrain_to_point_cloud
from rover_planner.planning.navigation.transforms import Rigid
from rover_planner.ros.qos import LATCHED_QOS, SENSOR_QOS
from support.grounds import RESOLUTION, plane
from support.messages import odometry_at, send_map_odom
from support.ros_fixtures import run_in_executor
from support.waiting import repeat_until, wait_until

MAP_ODOM = Rigid.from_rpy(1.0, -0.5, 0.4, 0.0, 0.0, np.pi / 2)
"""Where odometry began, on the map."""


def test_odometry_in_odom_serves_on_a_map_in_map(rover, start_controller):
    cloud = rover.create_publisher(PointCloud2, "elevation_cloud", LATCHED_QOS)
    cloud.publish(terrain_to_point_cloud(plane(0.0, 0.0, half=3.0), "map", Time()))
    controller = start_controller(transform_timeout=5.0)
    sender = rover.create_publisher(Odometry, "odometry", SENSOR_QOS)
    send = partial(sender.publish, odometry_at((0.5, 0.0, 0.0), frame="odom"))
    wait_for = partial(repeat_until, send)
    send_map_odom(controller, MAP_ODOM, age=7.5)
    stale = "the transform from 'odom' to 'map' is stale: it is "
    wait_for(lambda: rover.count_lines(stale), "the refusal of a stale transform")
    wait_for(lambda: rover.values.get("contact_source") == "motion", "the drive without the map")
    send_map_odom(controller, MAP_ODOM, is_static=True)
    wait_for(lambda: rover.values.get("contact_source") == "map", "contacts from the map")
    right = (1.0, 0.0, 0.4, np.pi / 2)
    np.testing.assert_allclose(controller.service._pose, right, atol=1e-9)
    of_mast = odometry_at((0.5, 0.0, 0.0))
    of_mast.child_frame_id = "mast"
    refused = "odometry not used: odometry is of frame 'mast'"
    repeat_until(partial(sender.publish, of_mast), partial(rover.count_lines, refused), "that")
    assert not rover.count_lines("rest by hold: odometry")


def test_a_cloud_in_odom_is_placed_on_the_map_and_refused_without_a_transform(
    rover, start_controller
):
    controller = start_controller(transform_timeout=5.0, map_resolution=RESOLUTION)
    ground = plane(0.1, 0.0, half=1.0)
    sender = rover.create_publisher(PointCloud2, "elevation_cloud", LATCHED_QOS)
    sender.publish(terrain_to_point_cloud(ground, "odom", rover.get_clock().now().to_msg()))
    refusal = "the last map stays: no transforms connect the frames 'odom' and 'map'"
    wait_until(lambda: rover.count_lines(refusal), "the refusal")
    assert controller.service.terrain is None
    send_map_odom(controller, MAP_ODOM)
    wait_until(lambda: controller.service.terrain is not None, "the map, without a new message")
    assert controller.service.terrain.bounds == pytest.approx((0.0, 2.0, -1.5, 0.5), abs=1e-6)
    assert rover.count_lines(refusal) == 1
    coarser = [Parameter("map_resolution", value=0.2)]
    run_in_executor(controller, lambda: controller.set_parameters(coarser))
    wait_until(lambda: controller.service.terrain.resolution == 0.2, "the map in other cells")
