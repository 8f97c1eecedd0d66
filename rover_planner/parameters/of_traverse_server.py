"""Parameters of `/traverse_server`."""

from rover_physics.bounds.path import SIGMAS
from rover_planner.parameters.of_maps import MAP_INTAKE
from rover_planner.parameters.spec import ParameterSpec

TRAVERSE_SERVER = (
    ParameterSpec("rover", "lsr1", "Rover to ask about: a preset's name or a rover file."),
    ParameterSpec(
        "friction",
        0.0,
        "Coulomb friction where the map has none; 0 takes the rover file's.",
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
        "soil",
        "",
        "Soil of config/soils.yaml where the map names none; empty is Coulomb friction.",
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
        "equal",
        "How the wheels share the traction: equal torques, or optimal with traction control.",
        choices=("equal", "optimal"),
    ),
    ParameterSpec(
        "candidate_count",
        9,
        "Largest number of candidate paths between start and goal.",
        bounds=(1, 99),
    ),
    ParameterSpec(
        "candidate_spacing",
        0.3,
        "Distance between neighbouring candidates half-way.",
        "m",
        bounds=(0.01, 10.0),
    ),
    ParameterSpec(
        "waypoint_spacing",
        0.02,
        "Largest distance between judged waypoints.",
        "m",
        bounds=(0.001, 1.0),
    ),
    ParameterSpec(
        "plan_spacing",
        0.1,
        "Distance between poses of a plan, which has those where the class changes too; "
        "0 returns every waypoint.",
        "m",
        bounds=(0.0, 100.0),
    ),
    ParameterSpec(
        "map_frame",
        "map",
        "Frame of the map; requests in another frame are refused.",
        read_only=True,
    ),
    *MAP_INTAKE,
    ParameterSpec(
        "unknown_cells",
        "refuse",
        "What becomes of unknown cells: refuse paths over them, or interpolate small gaps.",
        choices=("refuse", "interpolate"),
    ),
    ParameterSpec(
        "max_gap", 0.2, "Widest unknown region that is interpolated.", "m", bounds=(0.0, 100.0)
    ),
    ParameterSpec(
        "map_sigmas",
        SIGMAS,
        "Standard deviations by which heights may be wrong where the map has elevation_std; "
        "0 takes them as exact.",
        bounds=(0.0, 10.0),
    ),
    ParameterSpec(
        "terrain_file", "", "Terrain file to start with; empty waits for a map.", read_only=True
    ),
    ParameterSpec(
        "suspension_tolerance",
        0.1,
        "Difference of measured and predicted suspension angles that raises a warning.",
        "rad",
        bounds=(0.0, 3.2),
    ),
)
"""Parameters of `/traverse_server`."""
