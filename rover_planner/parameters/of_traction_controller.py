"""Parameters of `/traction_controller`."""

from rover_physics.names import WHEEL_JOINTS
from rover_planner.parameters.of_maps import MAP_INTAKE
from rover_planner.parameters.spec import ParameterSpec

TRACTION_CONTROLLER = (
    ParameterSpec("rover", "lsr1", "Rover that is driven: a preset's name or a rover file."),
    ParameterSpec(
        "joints",
        list(WHEEL_JOINTS),
        "Wheel joints in the order of the values of ~/commands.",
        read_only=True,
    ),
    ParameterSpec(
        "rate", 50.0, "Updates per second.", "1/s", bounds=(10.0, 500.0), read_only=True
    ),
    ParameterSpec(
        "realtime_priority",
        0,
        "Precedence of this process over ordinary ones (SCHED_FIFO), where granted; 0 for none.",
        bounds=(0, 99),
        read_only=True,
    ),
    ParameterSpec(
        "timeout",
        0.08,
        "Age from which joint states, attitude and cmd_vel are stale; torques are then zero.",
        "s",
        bounds=(0.01, 1.0),
    ),
    ParameterSpec(
        "odometry_timeout",
        0.5,
        "Age from which odometry is not used.",
        "s",
        bounds=(0.01, 10.0),
    ),
    ParameterSpec(
        "friction",
        0.0,
        "Coulomb friction that is counted on; 0 takes the rover file's.",
        bounds=(0.0, 10.0),
    ),
    ParameterSpec(
        "max_torque",
        0.0,
        "Largest torque of a wheel; 0 takes the rover file's.",
        "N m",
        bounds=(0.0, 1e6),
    ),
    ParameterSpec(
        "payload",
        -1.0,
        "Mass at the tip of the manipulator; -1 takes the rover file's.",
        "kg",
        bounds=(-1.0, 1e6),
    ),
    ParameterSpec(
        "policy",
        "optimal",
        "How the wheels share the traction: smallest peak friction utilisation, or equal torques.",
        choices=("equal", "optimal"),
    ),
    ParameterSpec("torque_rate", 20.0, "Largest change of a torque.", "N m/s", bounds=(0.1, 1e6)),
    ParameterSpec("speed_gain", 6.0, "Acceleration per error of speed.", "1/s", bounds=(0.0, 1e3)),
    ParameterSpec(
        "travel_gain", 12.0, "Acceleration per error of way.", "1/s^2", bounds=(0.0, 1e4)
    ),
    ParameterSpec(
        "heading_gain",
        2.0,
        "Angular acceleration per error of yaw rate.",
        "1/s",
        bounds=(0.0, 1e3),
    ),
    ParameterSpec(
        "slip_gain",
        1.0,
        "Torque against a wheel that leaves its rolling speed, in weights times radius squared.",
        "s/m",
        bounds=(0.0, 1e3),
    ),
    ParameterSpec(
        "map_frame",
        "map",
        "Frame of map and odometry; what comes in another frame is refused.",
        read_only=True,
    ),
    *MAP_INTAKE,
)
"""Parameters of `/traction_controller`."""
