# SPDX-License-Identifier: Apache-2.0
"""Parameters that several nodes share: values, and fields of their tables in capitals."""

from msg_adapters.gridding import CELL_HEIGHTS
from rover_physics.names import SUSPENSION_JOINTS
from rover_physics.rover.steering_joints import LEFT, RIGHT
from rover_physics.terrain.terrain_file import MAX_CELLS
from rover_planner.parameters.table import ParameterError, parameter

OWN_PAYLOAD = -1.0
"""Value of the parameter payload that selects the payload of the rover file [kg]."""
EITHER, TRANSIENT_LOCAL, VOLATILE = "either", "transient_local", "volatile"
MAP_DURABILITIES = (EITHER, TRANSIENT_LOCAL, VOLATILE)
"""Values of the parameter map_durability; `rover_planner.ros.qos` explains them."""

RELIABLE, BEST_EFFORT = "reliable", "best_effort"
RELIABILITIES = (RELIABLE, BEST_EFFORT)
"""Values of the parameter input_reliability."""


MAX_TORQUE: float = parameter(
    0.0, "Largest torque of a wheel; 0 uses that of the rover file.", "N m", (0.0, 1e6)
)
STEERING_SIGN: str = parameter(
    LEFT,
    "Side to which positive steering angles turn in messages.",
    choices=(LEFT, RIGHT),
    read_only=True,
)
BASE_OFFSET: tuple[float, ...] = parameter(
    (0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    "Pose of the model's body in the robot's frame, which starts, goals, paths, plans and "
    "odometry are of: x, y, z in m, roll, pitch, yaw in rad.",
    bounds=(-100.0, 100.0),
    read_only=True,
)
JOINT_MAP: tuple[str, ...] = parameter(
    tuple(f"{name}:{name}" for name in SUSPENSION_JOINTS),
    "Joints: model_joint:robot_joint, then :-1 if it turns the other way, then :offset, the "
    "model's angle in rad where the robot's is 0.",
    read_only=True,
)
STEERING_LIMIT: float = parameter(
    0.0,
    "Angle that the steering joints reach, beyond which a rover file is refused; 0 takes that of "
    "the rover file.",
    "rad",
    (0.0, 3.2),
)
PAYLOAD: float = parameter(
    OWN_PAYLOAD, "Mass at the arm's tip; -1 uses that of the rover file.", "kg", (OWN_PAYLOAD, 1e6)
)


def payload_or_none(payload: float) -> float | None:
    """Return the payload [kg], None for that of the rover file.

    Raises:
        ParameterError: The payload is below 0 and not OWN_PAYLOAD.
    """
    if payload == OWN_PAYLOAD:
        return None
    if payload < 0.0:
        raise ParameterError(
            f"parameter payload is {payload}; it must be a mass of 0 kg or more, "
            f"or {OWN_PAYLOAD:g} for that of the rover file"
        )
    return payload


MAP_RESOLUTION: float = parameter(
    0.0, "Cell size for clouds; 0 needs points on a regular grid.", "m", (0.0, 10.0)
)
CELL_HEIGHT: str = parameter(
    CELL_HEIGHTS[0],
    "Height of a cell with several points; max keeps obstacles, median ignores stray points.",
    choices=CELL_HEIGHTS,
)


MAX_MAP_CELLS: int = parameter(MAX_CELLS, "Largest terrain file.", "cells", (4, 10**9))
REALTIME_PRIORITY: int = parameter(
    0,
    "Real-time priority (SCHED_FIFO), in traverse_server of its heartbeat alone, beside which all "
    "else of it has a niceness of -10, if the system grants it; 0 for none.",
    bounds=(0, 99),
    read_only=True,
)
STOP = "traverse_server/stop"
"""Topic on which the watch of the accepted path says whether the rover is to stop."""


STOP_TIMEOUT: float = parameter(
    0.0,
    "Time without traverse_server/stop after which the rover stops; 0 only stops while it is "
    "true.",
    "s",
    (0.0, 10.0),
)
IMU_FRAME: str = parameter(
    "", "Frame of the IMU; empty is that of the body. Others are refused.", read_only=True
)
IMU_MOUNTING: tuple[float, ...] = parameter(
    (0.0, 0.0, 0.0),
    "Roll, pitch and yaw of the IMU's axes in the body frame.",
    "rad",
    (-6.3, 6.3),
    read_only=True,
)
MAP_DURABILITY: str = parameter(
    EITHER, "Durability of the maps' publishers.", choices=MAP_DURABILITIES, read_only=True
)
INPUT_RELIABILITY: str = parameter(
    RELIABLE,
    "Reliability of subscriptions to maps, paths and tool targets.",
    choices=RELIABILITIES,
    read_only=True,
)
