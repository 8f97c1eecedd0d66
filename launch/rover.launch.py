# SPDX-License-Identifier: Apache-2.0
"""The nodes of a rover: traverse server and traction controller.

ros2 launch rover_planner rover.launch.py namespace:=lsr1 traverse_server_parameters:=my.yaml

The traction controller starts disabled; call ~/enable to drive.
"""

from pathlib import Path

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

NODES = ("traverse_server", "traction_controller")
PARAMETERS = Path(__file__).absolute().parents[1] / "config" / "parameters"
"""Folder of the parameter files, in a checkout and where the package is installed."""
RESPAWN_DELAY = 1.0
"""Time after which a node that has ended is started again [s]."""
CONTROLLERS = PARAMETERS.parent / "ros2_control" / "controllers.yaml"
SPAWNED = ("joint_state_broadcaster", "imu_broadcaster", "wheel_efforts", "steering_positions")
"""Controllers of that file that are activated."""
CONNECTIONS = [
    ("~/commands", "wheel_efforts/commands"),
    ("~/steering_commands", "steering_positions/commands"),
    ("imu", "imu_broadcaster/imu"),
]
"""Topics of the traction controller, and those of ros2_control."""
STOP_TIMEOUT = 0.4
"""Time without a heartbeat of the watch after which the controller stops the rover [s]; the watch
has ten a second."""
ARGUMENTS = {
    "namespace": ("", "namespace of all nodes; diagnostics stay in /diagnostics"),
    "use_sim_time": ("false", "true takes the time from /clock"),
    "respawn": ("true", "whether a node that has ended is started again"),
    "rover": ("", "preset name or rover file; empty takes that of the parameter files"),
    "terrain_file": ("", "map to start with; empty takes that of the parameter file"),
    "traction_controller": ("true", "false starts the traverse server alone"),
    "urdf": (
        "",
        "URDF with <ros2_control>, as of rover_planner urdf --ros2-control: starts ros2_control "
        "and connects the traction controller to it",
    ),
    "watch": (
        "true",
        "whether the rover drives watched paths only, and stops without its watch; false leaves "
        "that to the parameter files",
    ),
    "traverse_server_parameters": (str(PARAMETERS / "traverse_server.yaml"), "parameter file"),
    "traction_controller_parameters": (
        str(PARAMETERS / "traction_controller.yaml"),
        "parameter file",
    ),
}
"""Default and meaning of each argument."""


def generate_launch_description() -> LaunchDescription:
    """Declare the arguments and start the nodes."""
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=meaning)
        for name, (default, meaning) in ARGUMENTS.items()
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=start_nodes)])


def start_nodes(context: LaunchContext) -> list[Node]:
    """Return the nodes; arguments that are given take precedence over the parameter files."""
    given = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    both = {"use_sim_time": is_true(given["use_sim_time"])}
    if given["rover"]:
        both["rover"] = given["rover"]
    own = {"terrain_file": given["terrain_file"]} if given["terrain_file"] else {}
    parameters = {"traverse_server": both | own, "traction_controller": dict(both)}
    if is_true(given["watch"]):
        parameters["traverse_server"]["monitor"] = True
        parameters["traction_controller"]["stop_timeout"] = STOP_TIMEOUT
    remappings = {name: [("diagnostics", "/diagnostics")] for name in NODES}
    hardware = []
    if given["urdf"]:
        remappings["traction_controller"] += CONNECTIONS
        hardware = start_hardware(given["urdf"], given["namespace"])
    wanted = NODES if is_true(given["traction_controller"]) else NODES[:1]
    return [
        Node(
            package="rover_planner",
            executable=name,
            name=name,
            namespace=given["namespace"],
            parameters=[given[f"{name}_parameters"], parameters[name]],
            remappings=remappings[name],
            output="screen",
            respawn=is_true(given["respawn"]),
            respawn_delay=RESPAWN_DELAY,
        )
        for name in wanted
    ] + hardware


def start_hardware(urdf: str, namespace: str) -> list[Node]:
    """Return the nodes of ros2_control, and the publisher of the robot's description."""
    description = {"robot_description": Path(urdf).read_text(encoding="utf-8")}
    return [
        Node(
            package="robot_state_publisher",
            executable="robot_state_publisher",
            namespace=namespace,
            parameters=[description],
        ),
        Node(
            package="controller_manager",
            executable="ros2_control_node",
            namespace=namespace,
            parameters=[str(CONTROLLERS)],
            remappings=[("~/robot_description", "robot_description")],
        ),
        Node(
            package="controller_manager",
            executable="spawner",
            namespace=namespace,
            arguments=[*SPAWNED, "--param-file", str(CONTROLLERS)],
        ),
    ]


def is_true(text: str) -> bool:
    """Return the value of an argument that is true or false."""
    if text.lower() not in ("true", "false", "1", "0"):
        raise ValueError(f"{text!r} must be true or false")
    return text.lower() in ("true", "1")
