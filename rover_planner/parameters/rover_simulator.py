# SPDX-License-Identifier: Apache-2.0
"""Parameters of `/rover_simulator`."""

from dataclasses import dataclass

from rover_physics.names import CONTROL_POLICIES, EQUAL, WHEEL_JOINTS
from rover_planner.parameters import shared
from rover_planner.parameters.table import ParameterTable, parameter

ALL_AROUND = 6.28
"""Value of sensor_field_of_view of a sensor that sees in all directions [rad]."""
QUASI_STATIC, MUJOCO = "quasi_static", "mujoco"
ENGINES = (QUASI_STATIC, MUJOCO)
"""Values of the parameter engine."""


@dataclass(frozen=True)
class RoverSimulatorParameters(ParameterTable):
    """Parameters of `/rover_simulator`; the fields document themselves."""

    all_read_only = True

    rover: str = parameter("lsr1", "Preset or rover file.")
    terrain_file: str = parameter("", "Terrain: a preset or terrain file; empty makes one.")
    max_map_cells: int = shared.MAX_MAP_CELLS
    start_x: float = parameter(0.0, "Start of the rover, x.", "m", (-1e6, 1e6))
    start_y: float = parameter(0.0, "Start of the rover, y.", "m", (-1e6, 1e6))
    start_yaw: float = parameter(0.0, "Heading at the start.", "rad", (-6.3, 6.3))
    engine: str = parameter(
        QUASI_STATIC, "Physics engine; mujoco needs the extra bench.", choices=ENGINES
    )
    friction: float = parameter(
        0.0, "Coulomb friction; 0 uses that of the terrain or the rover file.", bounds=(0.0, 10.0)
    )
    soil: str = parameter(
        "",
        "Soil where the terrain names none; empty is Coulomb friction. Quasi-static engine only.",
    )
    policy: str = parameter(
        EQUAL,
        "Torques of the rover's own servos. Quasi-static engine only, and not with "
        "follow_commands.",
        choices=CONTROL_POLICIES,
    )
    speed: float = parameter(
        0.0, "Speed along a path; 0 uses the rover's nominal speed.", "m/s", (0.0, 10.0)
    )
    follow_commands: bool = parameter(
        False, "Whether torques from traction_controller/commands drive the rover."
    )
    joints: tuple[str, ...] = parameter(WHEEL_JOINTS, "Wheel joints in the order of the commands.")
    timeout: float = parameter(
        0.5, "Age above which cmd_vel and torques are ignored.", "s", (0.01, 10.0)
    )
    stop_timeout: float = shared.STOP_TIMEOUT
    realtime_priority: int = shared.REALTIME_PRIORITY
    rate: float = parameter(50.0, "Steps per second.", "1/s", (5.0, 500.0))
    map_rate: float = parameter(0.5, "Maps per second.", "1/s", (0.01, 20.0))
    sensor_range: float = parameter(6.0, "Range of the terrain sensor.", "m", (0.5, 1e3))
    sensor_noise: float = parameter(
        0.0, "Standard deviation of the measured heights.", "m", (0.0, 1.0)
    )
    sensor_height: float = parameter(
        0.8, "Height of the sensor over the body's origin.", "m", (0.0, 10.0)
    )
    sensor_occlusion: bool = parameter(True, "Whether high ground hides the ground behind it.")
    sensor_field_of_view: float = parameter(
        ALL_AROUND,
        "Angle over which the sensor sees; 6.28 is all around.",
        "rad",
        (0.01, ALL_AROUND),
    )
    sensor_least_range: float = parameter(
        0.0, "Nearest ground that the sensor sees.", "m", (0.0, 100.0)
    )
    seed: int = parameter(1, "Seed of noise and of a generated terrain.", bounds=(0, 2**31 - 1))
    steering_sign: str = shared.STEERING_SIGN
    map_frame: str = parameter("map", "Frame of map, path and odometry.")
