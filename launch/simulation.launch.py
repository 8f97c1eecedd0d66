"""The whole system on one machine: simulator, traverse server and traction controller.

ros2 launch rover_planner simulation.launch.py terrain_file:=mars.npz

Then: ros2 run rover_planner mission_planner --start 0,0,0 --goal 3,0,0 --drive
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

ARGUMENTS = {
    "rover": ("lsr1", "preset name or rover file"),
    "terrain_file": ("", "terrain file, .npz; empty makes a Mars-like one"),
    "start_x": ("0.0", "m"),
    "start_y": ("0.0", "m"),
    "start_yaw": ("0.0", "rad"),
    "engine": ("quasi_static", "quasi_static or mujoco"),
    "speed": ("0.0", "m/s along a path; 0 takes the rover's own"),
}
"""Default and meaning of each argument."""
RESPAWN_DELAY = 1.0
"""Time after which a node that has ended is started again [s]."""
NUMBERS = ("start_x", "start_y", "start_yaw", "speed")


def generate_launch_description() -> LaunchDescription:
    """Start the three nodes; the rover is driven by the controller's torques."""
    given = {
        name: ParameterValue(
            LaunchConfiguration(name), value_type=float if name in NUMBERS else str
        )
        for name in ARGUMENTS
    }
    rover = {"rover": given["rover"]}
    nodes = {
        "rover_simulator": given | {"follow_commands": True},
        "traverse_server": rover,
        "traction_controller": rover | {"enabled_at_start": True},
    }
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=default, description=meaning)
                for name, (default, meaning) in ARGUMENTS.items()
            ),
            *(
                Node(
                    package="rover_planner",
                    executable=name,
                    name=name,
                    parameters=[parameters],
                    output="screen",
                    respawn=True,
                    respawn_delay=RESPAWN_DELAY,
                )
                for name, parameters in nodes.items()
            ),
        ]
    )
