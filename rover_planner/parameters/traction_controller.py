# SPDX-License-Identifier: Apache-2.0
"""Parameters of `/traction_controller`."""

from dataclasses import dataclass

from rover_physics.names import CONTROL_POLICIES, OPTIMAL, WHEEL_JOINTS
from rover_planner.parameters import shared
from rover_planner.parameters.table import ParameterTable, parameter

HOLD, BRAKE, COAST = "hold", "brake", "coast"
REST_POLICIES = (HOLD, BRAKE, COAST)
"""Values of the parameter rest_policy; `rover_planner.traction.supervisor` explains them."""


@dataclass(frozen=True)
class TractionControllerParameters(ParameterTable):
    """Parameters of `/traction_controller`; the fields document themselves."""

    rover: str = parameter("lsr1", "Preset or rover file.")
    joints: tuple[str, ...] = parameter(
        WHEEL_JOINTS, "Wheel joints in the order of the commands.", read_only=True
    )
    rate: float = parameter(50.0, "Updates per second.", "1/s", (10.0, 500.0), read_only=True)
    realtime_priority: int = shared.REALTIME_PRIORITY
    enabled_at_start: bool = parameter(
        False, "Whether the node drives without ~/enable; for simulations.", read_only=True
    )
    rest_policy: str = parameter(
        HOLD, "What the wheels do when the node does not drive.", choices=REST_POLICIES
    )
    stall_time: float = parameter(
        10.0, "Time without progress after which the node stops pushing.", "s", (0.5, 3600.0)
    )
    joint_states_timeout: float = parameter(
        0.06, "Age above which a wheel or suspension joint is a fault.", "s", (0.01, 1.0)
    )
    imu_timeout: float = parameter(
        0.06, "Age above which the attitude is a fault.", "s", (0.01, 1.0)
    )
    cmd_vel_timeout: float = parameter(
        0.5, "Age above which cmd_vel is a fault.", "s", (0.01, 10.0)
    )
    stop_timeout: float = shared.STOP_TIMEOUT
    odometry_timeout: float = parameter(
        0.5, "Age above which odometry is not used.", "s", (0.01, 10.0)
    )
    clock_timeout: float = parameter(
        0.05, "With use_sim_time: time for which /clock may stand still.", "s", (0.01, 10.0)
    )
    stamp_tolerance: float = parameter(
        0.05, "Time that a stamp may be ahead of the clock.", "s", (0.0, 1.0)
    )
    watchdog_timeout: float = parameter(
        0.08,
        "Time without an update until the watchdog sends zeros; at least two periods.",
        "s",
        (0.01, 1.0),
    )
    friction: float = parameter(
        0.0, "Assumed Coulomb friction; 0 uses that of the rover file.", bounds=(0.0, 10.0)
    )
    max_torque: float = shared.MAX_TORQUE
    payload: float = shared.PAYLOAD
    policy: str = parameter(
        OPTIMAL,
        "Torques of smallest peak friction utilisation, or equal ones.",
        choices=CONTROL_POLICIES,
    )
    torque_rate: float = parameter(
        0.0,
        "Largest change of a torque; 0 is a quarter of weight times wheel radius a second.",
        "N m/s",
        (0.0, 1e6),
    )
    speed_gain: float = parameter(6.0, "Acceleration per error of speed.", "1/s", (0.0, 1e3))
    travel_gain: float = parameter(
        12.0, "Acceleration per error of distance travelled.", "1/s^2", (0.0, 1e4)
    )
    heading_gain: float = parameter(
        2.0, "Angular acceleration per error of yaw rate.", "1/s", (0.0, 1e3)
    )
    slip_gain: float = parameter(
        0.4,
        "Torque per difference of a wheel's rate from rolling, over weight times radius squared.",
        "s/m",
        (0.0, 1e3),
    )
    steering_limit: float = shared.STEERING_LIMIT
    steering_sign: str = shared.STEERING_SIGN
    joint_map: tuple[str, ...] = shared.JOINT_MAP
    map_frame: str = parameter(
        "map", "Frame of the map; odometry in another frame needs /tf.", read_only=True
    )
    base_frame: str = parameter(
        "base_link", "Frame of the body, and odometry's child frame.", read_only=True
    )
    base_offset: tuple[float, ...] = shared.BASE_OFFSET
    transform_timeout: float = parameter(
        0.5, "Age from which a transform of /tf is refused.", "s", (0.01, 60.0)
    )
    imu_frame: str = shared.IMU_FRAME
    imu_mounting: tuple[float, ...] = shared.IMU_MOUNTING
    cmd_vel_stamped: bool = parameter(
        True, "Whether cmd_vel is a TwistStamped; false for a Twist.", read_only=True
    )
    map_resolution: float = shared.MAP_RESOLUTION
    cell_height: str = shared.CELL_HEIGHT
    map_durability: str = shared.MAP_DURABILITY
    input_reliability: str = shared.INPUT_RELIABILITY
