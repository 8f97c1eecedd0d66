# SPDX-License-Identifier: Apache-2.0
"""The whole system on one machine: simulator, traverse server and traction controller.

ros2 launch rover_planner simulation.launch.py terrain_file:=mars.npz

Then: ros2 run rover_planner mission_planner --start 0,0,0 --goal 3,0,0 --drive
"""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, GroupAction, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node, SetRemap
from launch_ros.parameter_descriptions import ParameterValue

HERE = Path(__file__).absolute().parent
PARAMETERS = HERE.parent / "config" / "parameters"
"""Folder of the parameter files, in a checkout and where the package is installed."""
RESPAWN_DELAY = 1.0
"""Time after which a node that has ended is started again [s]."""
ARGUMENTS = {
    "rover": ("lsr1", "preset name or rover file"),
    "terrain_file": ("", "terrain file, .npz; empty makes a Mars-like one"),
    "start_x": ("0.0", "m"),
    "start_y": ("0.0", "m"),
    "start_yaw": ("0.0", "rad"),
    "engine": ("quasi_static", "quasi_static or mujoco"),
    "speed": ("0.0", "m/s along a path; 0 takes the rover's own"),
}
"""Default and meaning of each argument that is a parameter of the simulator."""
NUMBERS = ("start_x", "start_y", "start_yaw", "speed")
SHARED = {
    "namespace": ("", "namespace of all nodes; diagnostics stay in /diagnostics"),
    "use_sim_time": ("false", "true takes the time from /clock, whose source is the simulator"),
    "respawn": ("true", "whether a node that has ended is started again"),
    "watch": ("true", "whether the rover drives watched paths only, and stops without its watch"),
    "rover_simulator_parameters": (str(PARAMETERS / "rover_simulator.yaml"), "parameter file"),
    "traverse_server_parameters": (str(PARAMETERS / "traverse_server.yaml"), "parameter file"),
    "traction_controller_parameters": (
        str(PARAMETERS / "simulated_traction_controller.yaml"),
        "parameter file; the one of the package enables the controller at start",
    ),
}
"""Default and meaning of the other arguments."""
FRAMES = [("/tf", "tf"), ("/tf_static", "tf_static")]
"""Topics of frames, which go into the namespace: each simulated rover has the same frames."""
PASSED_ON = ("namespace", "use_sim_time", "respawn", "rover", "watch",
             "traverse_server_parameters", "traction_controller_parameters")  # fmt: skip


def generate_launch_description() -> LaunchDescription:
    """Start the three nodes; the rover is driven by the controller's torques."""
    given = {name: LaunchConfiguration(name) for name in ARGUMENTS | SHARED}
    simulated = {
        name: ParameterValue(given[name], value_type=float if name in NUMBERS else str)
        for name in ARGUMENTS
    }
    simulated["use_sim_time"] = ParameterValue(given["use_sim_time"], value_type=bool)
    simulator = Node(
        package="rover_planner",
        executable="rover_simulator",
        name="rover_simulator",
        namespace=given["namespace"],
        parameters=[given["rover_simulator_parameters"], simulated],
        remappings=[("diagnostics", "/diagnostics"), *FRAMES],
        output="screen",
        respawn=given["respawn"],
        respawn_delay=RESPAWN_DELAY,
    )
    rover = IncludeLaunchDescription(
        PythonLaunchDescriptionSource(str(HERE / "rover.launch.py")),
        # The map is the simulator's; an included file would see the terrain_file of this one.
        launch_arguments=[("terrain_file", ""), *((name, given[name]) for name in PASSED_ON)],
    )
    remaps = [SetRemap(*names) for names in FRAMES]
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=meaning)
        for name, (default, meaning) in (ARGUMENTS | SHARED).items()
    ]
    return LaunchDescription([*declared, simulator, GroupAction([*remaps, rover])])
