# SPDX-License-Identifier: Apache-2.0
"""Parameters of `/traverse_server`."""

from dataclasses import dataclass

from rover_physics.names import EQUAL, TORQUE_POLICIES
from rover_physics.rover.uncertainty import ACCEPTED_CHANCE, SIGMAS
from rover_planner.maps.unobserved_ground import ALLOW, ALLOW_FOOTPRINT, REFUSE
from rover_planner.parameters import shared
from rover_planner.parameters.table import ParameterTable, parameter

INTERPOLATE = "interpolate"
"""Value of the parameter unknown_cells beside REFUSE."""
NEWEST, SUREST = "newest", "surest"
"""Values of the parameter map_merge: which of two heights of a cell counts, the newer one or the
one with the smaller deviation."""
MERGE, REPLACE = "merge", "replace"
"""Values of the parameter map_updates beside AUTO: a local map always merges, or always replaces
the last one; AUTO merges if there is a loaded map."""
NO_MOUNTS = ("base_link:0:0:0:0:0:0",)
"""Default of the parameter sensor_mounts, which shows its form and adds no sensor."""
FAN, LATTICE, AUTO = "fan", "lattice", "auto"
"""Values of the parameter planner."""
OFF, SUGGEST, USE = "off", "suggest", "use"
"""Values of the parameter learn."""


@dataclass(frozen=True)
class TraverseServerParameters(ParameterTable):
    """Parameters of `/traverse_server`; the fields document themselves."""

    rover: str = parameter("lsr1", "Preset or rover file.")
    friction: float = parameter(
        0.0,
        "Coulomb friction where the map has none; 0 uses that of the rover file.",
        bounds=(0.0, 10.0),
    )
    learn: str = parameter(
        SUGGEST,
        "Use of ~/ground_estimate: none (off), answers name it (suggest), or questions assume it "
        "where the map has no friction (use).",
        choices=(OFF, SUGGEST, USE),
    )
    max_torque: float = shared.MAX_TORQUE
    soil: str = parameter(
        "", "Soil of config/soils.yaml where the map names none; empty is Coulomb friction."
    )
    payload: float = shared.PAYLOAD
    policy: str = parameter(
        EQUAL,
        "How the wheels share the traction: equal torques, speed servos (servo), or optimal with "
        "traction control.",
        choices=TORQUE_POLICIES,
    )
    control_margin: float = parameter(
        0.0,
        "Share of friction and torque that optimal torques leave to a traction controller.",
        bounds=(0.0, 0.9),
    )
    candidate_count: int = parameter(9, "Largest number of candidate paths.", bounds=(1, 99))
    candidate_spacing: float = parameter(
        0.0,
        "Distance between candidates half-way; 0 is three wheel radii.",
        "m",
        (0.0, 10.0),
        least=0.01,
    )
    waypoint_spacing: float = parameter(
        0.0,
        "Largest distance between judged waypoints; 0 is a fifth of the wheel radius.",
        "m",
        (0.0, 1.0),
        least=0.001,
    )
    planner: str = parameter(
        AUTO,
        "Candidate curves (fan), a search (lattice), or a search if all candidates are refused "
        "(auto).",
        choices=(FAN, LATTICE, AUTO),
    )
    search_budget: float = parameter(2.0, "Time for a search.", "s", (0.05, 600.0))
    lattice_cell: float = parameter(
        0.0,
        "Distance between nodes of the search; 0 is a quarter of the wheelbase.",
        "m",
        (0.0, 10.0),
    )
    search_frontier: bool = parameter(
        False, "Whether a goal beyond the known ground is answered with a path to near it."
    )
    chance_weight: float = parameter(
        0.0,
        "How much longer a searched path may be to fail never instead of always.",
        "m",
        (0.0, 1e6),
    )
    plan_spacing: float = parameter(
        0.1,
        "Distance between poses of a plan, beside those where the class changes; 0 is every "
        "waypoint.",
        "m",
        (0.0, 100.0),
        least=0.001,
    )
    steering_limit: float = shared.STEERING_LIMIT
    steering_sign: str = shared.STEERING_SIGN
    joint_map: tuple[str, ...] = shared.JOINT_MAP
    map_frame: str = parameter(
        "map", "Frame of the map; requests in another frame need /tf.", read_only=True
    )
    base_frame: str = parameter("base_link", "Frame of the robot on /tf.", read_only=True)
    base_offset: tuple[float, ...] = shared.BASE_OFFSET
    transform_timeout: float = parameter(
        0.5,
        "Age from which a transform of /tf is refused, and odometry for a sensor's clouds.",
        "s",
        (0.01, 60.0),
    )
    sensor_mounts: tuple[str, ...] = parameter(
        NO_MOUNTS,
        "Poses of sensors in base_frame, for clouds in their frames: frame:x:y:z:roll:pitch:yaw, "
        "m and rad.",
        read_only=True,
    )
    map_resolution: float = shared.MAP_RESOLUTION
    cell_height: str = shared.CELL_HEIGHT
    map_durability: str = shared.MAP_DURABILITY
    input_reliability: str = shared.INPUT_RELIABILITY
    elevation_layer: str = parameter("elevation", "GridMap's layer of heights.", read_only=True)
    variance_layer: str = parameter(
        "variance",
        "GridMap's layer of the heights' variances; heights are exact without it.",
        unit="m^2",
        read_only=True,
    )
    friction_layer: str = parameter(
        "friction", "GridMap's layer of Coulomb friction.", read_only=True
    )
    map_updates: str = parameter(
        AUTO,
        "What a received map does; auto merges if a map was loaded.",
        choices=(AUTO, MERGE, REPLACE),
    )
    map_merge: str = parameter(
        NEWEST,
        "Which of two heights of a cell counts: the newer, or that of smaller deviation.",
        choices=(NEWEST, SUREST),
    )
    map_ageing: float = parameter(
        0.0,
        "Growth of a height's standard deviation with its age, for map_merge surest.",
        "m/s",
        (0.0, 10.0),
    )
    loaded_std: float = parameter(
        0.0,
        "Standard deviation of heights of a loaded map that has none; 0 is exact.",
        "m",
        (0.0, 1e3),
    )
    map_window: float = parameter(
        0.0,
        "Side of a window around the rover in which maps merge; 0 covers all.",
        "m",
        (0.0, 1e5),
    )
    fill_under_rover: bool = parameter(
        True, "Whether unknown ground under the rover is filled from its six contacts."
    )
    footprint_margin: float = parameter(
        0.0, "Width around the wheels that is also filled at the start.", "m", (0.0, 10.0)
    )
    footprint_std: float = parameter(
        0.02, "Standard deviation of filled heights on a map with deviations.", "m", (0.0, 10.0)
    )
    imu_attitude: bool = parameter(
        False, "Whether roll and pitch come from imu instead of odometry.", read_only=True
    )
    imu_frame: str = shared.IMU_FRAME
    imu_mounting: tuple[float, ...] = shared.IMU_MOUNTING
    blind_ground: str = parameter(
        ALLOW,
        "Unseen ground below the belly: allow, only if filled (allow_footprint), or refuse.",
        choices=(ALLOW, ALLOW_FOOTPRINT, REFUSE),
    )
    unknown_cells: str = parameter(
        REFUSE,
        "Unknown cells: refuse paths over them, or interpolate small gaps.",
        choices=(REFUSE, INTERPOLATE),
    )
    max_gap: float = parameter(0.2, "Widest gap that is interpolated.", "m", (0.0, 100.0))
    map_sigmas: float = parameter(
        SIGMAS,
        "Standard deviations of the map to allow for; 0 takes it as exact.",
        bounds=(0.0, 10.0),
    )
    accepted_chance: float = parameter(
        ACCEPTED_CHANCE,
        "Largest chance of failure of a traversable path; 1 does not ask for it.",
        bounds=(0.0, 1.0),
    )
    terrain_file: str = parameter(
        "", "Map to start with: a preset or terrain file; empty waits for a map.", read_only=True
    )
    max_map_age: float = parameter(
        0.0, "Age from which a map is refused as stale_map; 0 allows any.", "s", (0.0, 1e9)
    )
    time_budget: float = parameter(
        5.0, "Longest time from question to answer.", "s", (0.05, 600.0)
    )
    advice_time: float = parameter(
        5.0, "Longest time from ~/advise to its answer; questions come first.", "s", (0.05, 600.0)
    )
    max_waiting: int = parameter(50, "Questions that may wait; more are busy.", bounds=(0, 1000))
    map_folder: str = parameter(
        "~/maps", "Folder below which ~/load_map reads; ~ is the user's home, / allows every file."
    )
    max_path_poses: int = parameter(
        1500,
        "Most poses of ~/path, ~/is_path_valid; each takes 30 us, in which nothing else is heard.",
        bounds=(2, 100_000),
    )
    max_map_bytes: int = parameter(
        1_000_000_000, "Largest file that ~/load_map reads.", "bytes", (1000, 10**12)
    )
    max_map_cells: int = shared.MAX_MAP_CELLS
    suspension_tolerance: float = parameter(
        0.1,
        "Difference of measured and predicted suspension angles above which there is a warning.",
        "rad",
        (0.0, 3.2),
    )

    monitor: bool = parameter(
        False,
        "Whether the accepted path is watched; ~/stop is then true unless the rover may drive it.",
    )
    monitor_offset: float = parameter(
        0.0,
        "Distance from its path above which the rover is to stop; 0 is five wheel radii.",
        "m",
        (0.0, 100.0),
        least=0.01,
    )
    monitor_timeout: float = parameter(
        1.0,
        "Time without the rover's pose, or joint states that were there, after which it is to "
        "stop.",
        "s",
        (0.1, 60.0),
    )
    monitor_mismatch: float = parameter(
        0.3,
        "Difference of suspension angles above which the rover is to stop after a second; 0 "
        "never.",
        "rad",
        (0.0, 3.2),
    )

    realtime_priority: int = shared.REALTIME_PRIORITY

    hazard_map: bool = parameter(
        False, "Whether ~/hazard_map has the class of each cell and heading."
    )
    hazard_headings: int = parameter(
        8, "Headings of the hazard map.", bounds=(1, 36), read_only=True
    )
