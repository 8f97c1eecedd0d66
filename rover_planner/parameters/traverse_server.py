# SPDX-License-Identifier: Apache-2.0
"""Parameters of `/traverse_server`."""

from dataclasses import dataclass

from rover_physics.bounds.path import SIGMAS
from rover_physics.names import EQUAL, TORQUE_POLICIES
from rover_physics.rover.uncertainty import ACCEPTED_CHANCE
from rover_planner.maps.living_map import AUTO as AUTO_UPDATES
from rover_planner.maps.living_map import MAP_UPDATES, MERGE_RULES, NEWEST
from rover_planner.maps.unobserved_ground import ALLOW, UNOBSERVED_GROUND
from rover_planner.parameters import shared
from rover_planner.parameters.table import ParameterError, ParameterTable, parameter

MIN_PLAN_SPACING = 0.001
"""Smallest plan_spacing other than 0 [m]."""
REFUSE, INTERPOLATE = "refuse", "interpolate"
"""Values of the parameter unknown_cells."""
NO_MOUNTS = ("base_link:0:0:0:0:0:0",)
"""Default of the parameter sensor_mounts, which shows its form and adds no sensor."""
FAN, LATTICE, AUTO = "fan", "lattice", "auto"
"""Values of the parameter planner."""
OFF, SUGGEST, USE = "off", "suggest", "use"
"""Values of the parameter learn."""


@dataclass(frozen=True)
class TraverseServerParameters(ParameterTable):
    """Parameters of `/traverse_server`; the fields document themselves."""

    rover: str = parameter("lsr1", "Rover of all queries: a preset's name or a rover file.")
    friction: float = parameter(
        0.0,
        "Coulomb friction where the map has none; 0 uses that of the rover file.",
        bounds=(0.0, 10.0),
    )
    learn: str = parameter(
        SUGGEST,
        "What ~/ground_estimate does: nothing (off), answers name it (suggest), or new questions "
        "assume its friction and uncertainty where the map has none (use).",
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
        "Share of friction and torque that optimal torques leave to a traction controller, beside "
        "what accepted_chance does; 0 is the physical limit.",
        bounds=(0.0, 0.9),
    )
    candidate_count: int = parameter(
        9, "Largest number of candidate paths between start and goal.", bounds=(1, 99)
    )
    candidate_spacing: float = parameter(
        0.3, "Distance between neighbouring candidates half-way.", unit="m", bounds=(0.01, 10.0)
    )
    waypoint_spacing: float = parameter(
        0.02, "Largest distance between judged waypoints.", unit="m", bounds=(0.001, 1.0)
    )
    planner: str = parameter(
        AUTO,
        "Candidate curves (fan), a search around obstacles (lattice), or a search if all "
        "candidates are refused (auto).",
        choices=(FAN, LATTICE, AUTO),
    )
    search_budget: float = parameter(
        2.0, "Time for a search around obstacles.", unit="s", bounds=(0.05, 600.0)
    )
    lattice_cell: float = parameter(
        0.0,
        "Distance of the places that the search connects; 0 is a quarter of the wheelbase.",
        unit="m",
        bounds=(0.0, 10.0),
    )
    search_frontier: bool = parameter(
        False, "Whether a goal beyond the known ground is answered with a path to near it."
    )
    chance_weight: float = parameter(
        0.0,
        "Length that a path of a search may be longer to fail never instead of always; 0 does not "
        "weigh chances.",
        unit="m",
        bounds=(0.0, 1e6),
    )
    plan_spacing: float = parameter(
        0.1,
        "Distance between poses of a plan, which also has those where the class changes; "
        "0 is every waypoint.",
        unit="m",
        bounds=(0.0, 100.0),
    )
    steering_limit: float = shared.STEERING_LIMIT
    steering_sign: str = shared.STEERING_SIGN
    joint_map: tuple[str, ...] = shared.JOINT_MAP
    map_frame: str = parameter(
        "map",
        "Frame of the map; requests in another frame need a transform of /tf.",
        read_only=True,
    )
    base_frame: str = parameter(
        "base_link", "Frame of the robot on /tf, where tf2_msgs is installed.", read_only=True
    )
    base_offset: tuple[float, ...] = shared.BASE_OFFSET
    transform_timeout: float = parameter(
        0.5,
        "Age from which a transform of /tf is refused, and odometry for clouds of a sensor.",
        unit="s",
        bounds=(0.01, 60.0),
    )
    sensor_mounts: tuple[str, ...] = parameter(
        NO_MOUNTS,
        "Poses of sensors in base_frame, for clouds in their frames: frame:x:y:z:roll:pitch:yaw, "
        "m and rad. Other frames are looked up on /tf.",
        read_only=True,
    )
    map_resolution: float = shared.MAP_RESOLUTION
    cell_height: str = shared.CELL_HEIGHT
    map_durability: str = shared.MAP_DURABILITY
    input_reliability: str = shared.INPUT_RELIABILITY
    elevation_layer: str = parameter(
        "elevation", "Layer of heights in a GridMap on elevation_map.", read_only=True
    )
    variance_layer: str = parameter(
        "variance",
        "Layer of the heights' variances in a GridMap; a map without it has exact heights.",
        unit="m^2",
        read_only=True,
    )
    friction_layer: str = parameter(
        "friction",
        "Layer of Coulomb friction in a GridMap; a map without it has that of friction.",
        read_only=True,
    )
    map_updates: str = parameter(
        AUTO_UPDATES,
        "What a received map does: merge, replace, or merge only if a map was loaded (auto).",
        choices=MAP_UPDATES,
    )
    map_merge: str = parameter(
        NEWEST,
        "Which of two heights of a cell counts: the newer, or that of smaller deviation.",
        choices=MERGE_RULES,
    )
    map_ageing: float = parameter(
        0.0,
        "Growth of a height's standard deviation with its age, for map_merge surest.",
        unit="m/s",
        bounds=(0.0, 10.0),
    )
    loaded_std: float = parameter(
        0.0,
        "Standard deviation of the heights of a loaded map without elevation_std; 0 is exact.",
        unit="m",
        bounds=(0.0, 1e3),
    )
    map_window: float = parameter(
        0.0,
        "Side of a window around the rover in which maps merge; 0 covers all that was seen.",
        unit="m",
        bounds=(0.0, 1e5),
    )
    fill_under_rover: bool = parameter(
        True, "Whether unknown ground under the standing rover is filled from its six contacts."
    )
    footprint_margin: float = parameter(
        0.0,
        "Width around the wheels that is also filled where the rover starts.",
        unit="m",
        bounds=(0.0, 10.0),
    )
    footprint_std: float = parameter(
        0.02,
        "Standard deviation of filled heights on a map that has deviations.",
        unit="m",
        bounds=(0.0, 10.0),
    )
    imu_attitude: bool = parameter(
        False,
        "Whether roll and pitch of the standing rover are those of imu instead of odometry.",
        read_only=True,
    )
    imu_frame: str = shared.IMU_FRAME
    imu_mounting: tuple[float, ...] = shared.IMU_MOUNTING
    blind_ground: str = parameter(
        ALLOW,
        "Ground below the belly that was never seen: allow, only if filled (allow_footprint), or "
        "refuse.",
        choices=UNOBSERVED_GROUND,
    )
    unknown_cells: str = parameter(
        REFUSE,
        "Unknown cells: refuse paths over them, or interpolate small gaps.",
        choices=(REFUSE, INTERPOLATE),
    )
    max_gap: float = parameter(
        0.2, "Widest unknown region that is interpolated.", unit="m", bounds=(0.0, 100.0)
    )
    map_sigmas: float = parameter(
        SIGMAS,
        "Standard deviations to allow for if the map has elevation_std; 0 takes it as exact.",
        bounds=(0.0, 10.0),
    )
    accepted_chance: float = parameter(
        ACCEPTED_CHANCE,
        "Largest chance of failure of a path that is traversable; 1 does not ask for it.",
        bounds=(0.0, 1.0),
    )
    terrain_file: str = parameter(
        "",
        "Map to start with: a preset's name or a terrain file; empty waits for a map.",
        read_only=True,
    )
    max_map_age: float = parameter(
        0.0,
        "Age from which a map is refused as stale_map; 0 allows any age.",
        unit="s",
        bounds=(0.0, 1e9),
    )
    time_budget: float = parameter(
        5.0,
        "Longest time from a question's arrival to its answer.",
        unit="s",
        bounds=(0.05, 600.0),
    )
    advice_time: float = parameter(
        5.0,
        "Longest time from a call of ~/advise to its answer; questions come first.",
        unit="s",
        bounds=(0.05, 600.0),
    )
    max_waiting: int = parameter(
        50, "Questions that may wait; further ones are busy.", bounds=(0, 1000)
    )
    map_folder: str = parameter(
        "~/maps",
        "Folder below which ~/load_map reads, where relative names start; ~ is the user's home, / "
        "allows every file.",
    )
    max_path_poses: int = parameter(
        1500,
        "Largest number of poses of ~/path, ~/is_path_valid. A longer ~/path is refused before it "
        "is read, which takes some 30 us a pose; nothing else is heard meanwhile.",
        bounds=(2, 100_000),
    )
    max_map_bytes: int = parameter(
        1_000_000_000, "Largest file that ~/load_map reads.", unit="bytes", bounds=(1000, 10**12)
    )
    max_map_cells: int = shared.MAX_MAP_CELLS
    suspension_tolerance: float = parameter(
        0.1,
        "Largest difference of measured and predicted suspension angles without a warning.",
        unit="rad",
        bounds=(0.0, 3.2),
    )

    monitor: bool = parameter(
        False,
        "Whether the accepted path is judged again with each map; ~/stop is then true unless the "
        "rover may drive it.",
    )
    monitor_offset: float = parameter(
        0.5,
        "Distance of the rover from its path above which it is to stop.",
        unit="m",
        bounds=(0.01, 100.0),
    )
    monitor_timeout: float = parameter(
        1.0,
        "Time without a pose of the rover, or joint states that were there, after which it is to "
        "stop.",
        unit="s",
        bounds=(0.1, 60.0),
    )
    monitor_mismatch: float = parameter(
        0.3,
        "Difference of measured and predicted suspension angles that stops the rover after a "
        "second; 0 never.",
        unit="rad",
        bounds=(0.0, 3.2),
    )

    hazard_map: bool = parameter(
        False, "Whether the class of each cell and heading is kept up to date on ~/hazard_map."
    )
    hazard_headings: int = parameter(
        8, "Number of headings of the hazard map.", bounds=(1, 36), read_only=True
    )

    def __post_init__(self) -> None:
        """Check all values.

        Raises:
            ParameterError: As for all tables, or plan_spacing is too small.
        """
        super().__post_init__()
        if 0.0 < self.plan_spacing < MIN_PLAN_SPACING:
            raise ParameterError(
                f"parameter plan_spacing is {self.plan_spacing}; it must be 0, or at least "
                f"{MIN_PLAN_SPACING:g} m"
            )
