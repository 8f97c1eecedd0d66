# SPDX-License-Identifier: Apache-2.0
"""Parameters of `/ground_learner`."""

from dataclasses import dataclass

from rover_planner.parameters import shared
from rover_planner.parameters.table import ParameterTable, parameter


@dataclass(frozen=True)
class GroundLearnerParameters(ParameterTable):
    """Parameters of `/ground_learner`; the fields document themselves."""

    rover: str = parameter("lsr1", "Preset or rover file.", read_only=True)
    friction: float = parameter(
        0.0,
        "Friction that is assumed at first; 0 uses that of the rover file.",
        bounds=(0.0, 10.0),
        read_only=True,
    )
    soil: str = parameter(
        "", "Soil that is assumed at first, on ground that yields, and learned.", read_only=True
    )
    stop_when_stuck: bool = parameter(
        False, "Whether a rover that is stuck gets an emergency stop."
    )
    mark_when_stuck: bool = parameter(
        False, "Whether the place ahead of a rover that is stuck is marked as impassable."
    )
    map_frame: str = parameter(
        "map", "Frame of map and odometry; others are refused.", read_only=True
    )
    odometry_frame: str = parameter(
        "odom", "Frame of the wheel odometry on ~/odometry.", read_only=True
    )
    steering_sign: str = shared.STEERING_SIGN
    joint_map: tuple[str, ...] = shared.JOINT_MAP
    imu_frame: str = shared.IMU_FRAME
    imu_mounting: tuple[float, ...] = shared.IMU_MOUNTING
    map_resolution: float = shared.MAP_RESOLUTION
    cell_height: str = shared.CELL_HEIGHT
    map_durability: str = shared.MAP_DURABILITY
    input_reliability: str = shared.INPUT_RELIABILITY
