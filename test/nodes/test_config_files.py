# SPDX-License-Identifier: Apache-2.0
"""The shipped parameter files name parameters that exist, and joints that fit together."""

import pytest
import yaml

from msg_adapters.commands import joint_order
from msg_adapters.joints import read_joint_map
from rover_physics.names import STEERING_JOINTS, SUSPENSION_JOINTS, WHEEL_JOINTS
from rover_physics.rover.rover_file import load_rover
from rover_physics.rover.steering_joints import steering_joints
from support.project.checkout import TOP
from support.project.command_checks import check_parameter_file

CONFIG = TOP / "config"


@pytest.mark.parametrize(
    ("file", "node"),
    [
        ("nav2/watch.yaml", "traverse_server"),
        ("ros2_control/joints.yaml", "traverse_server"),
        ("ros2_control/joints.yaml", "traction_controller"),
    ],
)
def test_every_parameter_of_a_file_is_one_of_its_node(file, node):
    check_parameter_file(node, CONFIG / file)


def test_the_groups_of_ros2_control_have_the_joints_and_order_of_the_map():
    def read(name):
        return yaml.safe_load((CONFIG / "ros2_control" / name).read_text(encoding="utf-8"))

    groups, nodes = read("controllers.yaml"), read("joints.yaml")
    known = (*SUSPENSION_JOINTS, *WHEEL_JOINTS, *STEERING_JOINTS)
    names = read_joint_map(nodes["/**"]["ros__parameters"]["joint_map"], known)
    wheels = nodes["traction_controller"]["ros__parameters"]["joints"]
    assert sorted(joint_order(wheels, names).tolist()) == list(range(6))
    for group in ("wheel_efforts", "wheel_velocities"):
        assert groups[group]["ros__parameters"]["joints"] == wheels
    for preset in ("lsr1", "m2020"):
        steered = names.robot_names(steering_joints(load_rover(preset)))
        assert groups["steering_positions"]["ros__parameters"]["joints"] == list(steered)
    kinds = groups["controller_manager"]["ros__parameters"]
    assert {"wheel_efforts", "wheel_velocities", "steering_positions"} <= set(kinds)


@pytest.mark.parametrize("file", ["hazard_layer.yaml", "hazard_filter.yaml"])
def test_the_files_for_nav2_read_the_topics_of_the_server(file):
    text = (CONFIG / "nav2" / file).read_text(encoding="utf-8")
    assert yaml.safe_load(text)["global_costmap"]["global_costmap"]["ros__parameters"]
    assert ": /traverse_server/hazard_map/worst" in text
