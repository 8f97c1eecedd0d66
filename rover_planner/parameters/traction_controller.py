"""Parameters of `/traction_controller`."""

from dataclasses import dataclass

from rover_physics.names import OPTIMAL, TORQUE_POLICIES, WHEEL_JOINTS
from rover_planner.parameters.shared import (
    cell_height_parameter,
    map_durability_parameter,
    map_resolution_parameter,
    max_torque_parameter,
    payload_parameter,
)
from rover_planner.parameters.table import ParameterTable, parameter


@dataclass(frozen=True)
class TractionControllerParameters(ParameterTable):
    """Parameters of `/traction_controller`; the fields document themselves."""

    rover: str = parameter("lsr1", "Rover that is driven: a preset's name or a rover file.")
    joints: tuple[str, ...] = parameter(
        WHEEL_JOINTS, "Wheel joints in the order of the values of ~/commands.", read_only=True
    )
    rate: float = parameter(
        50.0, "Updates per second.", unit="1/s", bounds=(10.0, 500.0), read_only=True
    )
    realtime_priority: int = parameter(
        0,
        "Real-time priority of this process (SCHED_FIFO), where the system grants it; 0 for none.",
        bounds=(0, 99),
        read_only=True,
    )
    timeout: float = parameter(
        0.08,
        "Age above which joint states, attitude and cmd_vel are stale; torques are then zero.",
        unit="s",
        bounds=(0.01, 1.0),
    )
    odometry_timeout: float = parameter(
        0.5, "Age above which odometry is not used.", unit="s", bounds=(0.01, 10.0)
    )
    friction: float = parameter(
        0.0, "Assumed Coulomb friction; 0 uses that of the rover file.", bounds=(0.0, 10.0)
    )
    max_torque: float = max_torque_parameter()
    payload: float = payload_parameter()
    policy: str = parameter(
        OPTIMAL,
        "How the wheels share the traction: smallest peak friction utilisation, or equal torques.",
        choices=TORQUE_POLICIES,
    )
    torque_rate: float = parameter(
        20.0, "Largest rate of change of a torque.", unit="N m/s", bounds=(0.1, 1e6)
    )
    speed_gain: float = parameter(
        6.0, "Acceleration per error of speed.", unit="1/s", bounds=(0.0, 1e3)
    )
    travel_gain: float = parameter(
        12.0, "Acceleration per error of distance travelled.", unit="1/s^2", bounds=(0.0, 1e4)
    )
    heading_gain: float = parameter(
        2.0, "Angular acceleration per error of yaw rate.", unit="1/s", bounds=(0.0, 1e3)
    )
    slip_gain: float = parameter(
        1.0,
        "Torque per difference of a wheel's rate from rolling, in weights times radius squared.",
        unit="s/m",
        bounds=(0.0, 1e3),
    )
    map_frame: str = parameter(
        "map", "Frame of map and odometry; messages in another frame are refused.", read_only=True
    )
    map_resolution: float = map_resolution_parameter()
    cell_height: str = cell_height_parameter()
    map_durability: str = map_durability_parameter()
