# SPDX-License-Identifier: Apache-2.0
"""A robot with its own joint names, mirrored motors and an encoder offset is driven over DDS.

The shipped controllers of ros2_control are held against the controller's order in test_launch.py.
"""

import numpy as np
from std_msgs.msg import Float64MultiArray

from rover_physics.names import WHEEL_JOINTS
from rover_physics.rover.steered_drive import SteeredDrive
from rover_physics.rover.steering_joints import steered_wheels, steering_joints
from rover_planner.nodes.traction_controller import NODE_NAME
from rover_planner.nodes.warm_up import JOINTS
from support.ros_fixtures import hear
from support.rovers import LSR1
from support.waiting import wait_until

SIGNS = {name: -1.0 if "left" in name else 1.0 for name in JOINTS}
OFFSET = 0.02
"""Of the model's angle of the right rocker [rad]."""
SPEED, YAW_RATE = 0.03, 0.03


def test_rates_and_steering_angles_are_those_of_the_commanded_motion(rover, start_controller):
    efforts, speeds, turns = (
        hear(rover, Float64MultiArray, f"{NODE_NAME}/{group}")
        for group in ("commands", "velocity_commands", "steering_commands")
    )
    aims = SteeredDrive(LSR1).aim(SPEED, YAW_RATE)
    names, steering = steering_joints(LSR1), aims.angles[steered_wheels(LSR1)]
    angles = dict.fromkeys(JOINTS, 0.0) | dict(zip(names, steering.tolist(), strict=True))
    angles["rocker_right"] -= OFFSET
    rover.joints.name = [f"robot_{name}" for name in JOINTS]
    rover.joints.position = [SIGNS[name] * angles[name] for name in JOINTS]
    rover.joints.velocity = [SIGNS[name] * 0.2 * (name in WHEEL_JOINTS) for name in JOINTS]
    rover.twist.twist.angular.z = YAW_RATE
    controller = start_controller(
        joint_map=[
            f"{name}:robot_{name}:{SIGNS[name]:.0f}:{OFFSET * (name == 'rocker_right')}"
            for name in JOINTS
        ],
        joints=[f"robot_{name}" for name in WHEEL_JOINTS[::-1]],
    )
    rates = aims.speeds / LSR1.wheel.radius * [SIGNS[name] for name in WHEEL_JOINTS]
    turned = steering * [SIGNS[name] for name in names]

    def is_told(heard: list[Float64MultiArray], right: np.ndarray) -> bool:
        return heard and np.allclose(heard[-1].data, right, rtol=0.0, atol=1e-6)

    wait_until(lambda: is_told(speeds, rates[::-1]), "the rates")
    wait_until(lambda: is_told(turns, turned), "the angles")
    signs = np.array([SIGNS[name] for name in WHEEL_JOINTS[::-1]])
    wait_until(lambda: efforts and efforts[-1].data @ signs > 0.0, "the efforts")
    assert np.abs(controller.service.joints.suspension_angles).max() < 1e-9
