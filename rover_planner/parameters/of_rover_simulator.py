"""Parameters of `/rover_simulator`."""

from rover_physics.names import WHEEL_JOINTS
from rover_planner.parameters.spec import ParameterSpec

ROVER_SIMULATOR = (
    ParameterSpec(
        "rover",
        "lsr1",
        "Rover that is simulated: a preset's name or a rover file.",
        read_only=True,
    ),
    ParameterSpec(
        "terrain_file",
        "",
        "Terrain it drives on, .npz; empty makes a Mars-like one.",
        read_only=True,
    ),
    ParameterSpec("start_x", 0.0, "Where it starts.", "m", bounds=(-1e6, 1e6), read_only=True),
    ParameterSpec("start_y", 0.0, "Where it starts.", "m", bounds=(-1e6, 1e6), read_only=True),
    ParameterSpec("start_yaw", 0.0, "Its heading.", "rad", bounds=(-6.3, 6.3), read_only=True),
    ParameterSpec(
        "engine",
        "quasi_static",
        "What moves it: the model itself, or MuJoCo (extra bench).",
        choices=("quasi_static", "mujoco"),
        read_only=True,
    ),
    ParameterSpec(
        "friction",
        0.0,
        "Coulomb friction of the ground; 0 takes the terrain's or the rover file's.",
        bounds=(0.0, 10.0),
        read_only=True,
    ),
    ParameterSpec(
        "soil",
        "",
        "Soil of config/soils.yaml where the terrain names none; empty is Coulomb friction. "
        "Quasi-static engine only.",
        read_only=True,
    ),
    ParameterSpec(
        "policy",
        "equal",
        "How its own servos share the traction: equal torques, or optimal. Quasi-static engine "
        "only, and not with follow_commands.",
        choices=("equal", "optimal"),
        read_only=True,
    ),
    ParameterSpec(
        "speed",
        0.0,
        "Speed along a path; 0 takes the rover's nominal speed.",
        "m/s",
        bounds=(0.0, 10.0),
        read_only=True,
    ),
    ParameterSpec(
        "follow_commands",
        False,
        "Whether torques from /traction_controller/commands drive it; cmd_vel is published then, "
        "unless it comes from elsewhere.",
        read_only=True,
    ),
    ParameterSpec(
        "joints",
        list(WHEEL_JOINTS),
        "Wheel joints in the order of the values of the torques.",
        read_only=True,
    ),
    ParameterSpec(
        "timeout",
        0.5,
        "Age from which cmd_vel and torques count no more.",
        "s",
        bounds=(0.01, 10.0),
        read_only=True,
    ),
    ParameterSpec("rate", 50.0, "Steps per second.", "1/s", bounds=(5.0, 500.0), read_only=True),
    ParameterSpec("map_rate", 0.5, "Maps per second.", "1/s", bounds=(0.01, 20.0), read_only=True),
    ParameterSpec("sensor_range", 6.0, "How far it sees.", "m", bounds=(0.5, 1e3), read_only=True),
    ParameterSpec(
        "sensor_noise",
        0.0,
        "Standard deviation of the heights it sees; it goes with them as elevation_std.",
        "m",
        bounds=(0.0, 1.0),
        read_only=True,
    ),
    ParameterSpec(
        "sensor_height",
        0.8,
        "Height of the sensor over the body's origin.",
        "m",
        bounds=(0.0, 10.0),
        read_only=True,
    ),
    ParameterSpec(
        "sensor_occlusion",
        True,
        "Whether ground hides what is behind it.",
        read_only=True,
    ),
    ParameterSpec(
        "seed", 1, "Seed of noise and of a made terrain.", bounds=(0, 2**31 - 1), read_only=True
    ),
    ParameterSpec("map_frame", "map", "Frame of map, path and odometry.", read_only=True),
)
"""Parameters of `/rover_simulator`."""
