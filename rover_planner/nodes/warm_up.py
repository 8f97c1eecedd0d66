# SPDX-License-Identifier: Apache-2.0
"""The kernels of the nodes beyond those of rover_physics, and the groups of all kernels."""

import itertools
from collections.abc import Callable, Sequence

import numpy as np

from rover_physics.bounds.path import is_uncertain
from rover_physics.compilation import NICENESS, Compilation, Step
from rover_physics.names import STEERING_JOINTS, SUSPENSION_JOINTS, WHEEL_JOINTS
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.pose_classes import RoverOnMap, classify_poses
from rover_physics.warm_up import EXACT, UNCERTAIN, bound_poses
from rover_planner.learning.drive_log import FORCES, TIME, WIDTH
from rover_planner.learning.ground_learner import GroundLearner
from rover_planner.parameters.traction_controller import TractionControllerParameters
from rover_planner.planning.search.difficulty import estimate_difficulty
from rover_planner.planning.search.edges import Edges, make_primitives
from rover_planner.planning.search.graph import Seeds, ShortestPaths
from rover_planner.planning.search.nodes import nodes_within
from rover_planner.planning.search.path_search import find_path
from rover_planner.planning.search.query import LatticeSettings, SearchQuery, Site
from rover_planner.simulator.quasi_static_plant import QuasiStaticPlant
from rover_planner.traction.settings import TractionSettings, load_traction_settings
from rover_planner.traction.supervisor import TractionSupervisor

JOINTS = (*SUSPENSION_JOINTS, *WHEEL_JOINTS, *STEERING_JOINTS)


def search_paths() -> None:
    """Search a path around the end of a wall, and where a wall leaves none; few nodes will do.

    A server runs this at each start, when its kernels are on disk.
    """
    ends = (0.7, 1.5, 0.0), (2.3, 1.5, 0.0)
    for rows in (35, 60):
        elevation = np.zeros((60, 60))
        elevation[:rows, 30] = 1.0
        ground = Terrain(elevation, 0.05, (0.0, 0.0))
        site = Site(load_rover("lsr1"), ground)
        find_path(SearchQuery(site, *ends), LatticeSettings(budget=60.0, cell=0.4))


def prepare_search(site: Site) -> None:
    """Load all kernels that a search at a site needs, so that its budget is not spent on it."""
    search_paths()
    if is_uncertain(site.terrain, site.options.map_sigmas):
        bound_poses()


def search_lattice() -> None:
    """Search a path over a lattice of which nothing is known, without the model of a pose."""
    rover, ground = load_rover("lsr1"), Terrain(np.zeros((60, 60)), 0.05, (0.0, 0.0))
    nodes = nodes_within(0.2, (1.0, 1.0), (2.0, 2.0))
    edges = Edges(nodes, make_primitives(rover, nodes.cell, 0.1))
    difficulty = estimate_difficulty(rover, ground, nodes, 0.5, edges.primitives)
    start, goal = (Seeds(np.array([node]), np.zeros(1)) for node in (0, nodes.count - 1))
    search = ShortestPaths(edges, difficulty, start)
    for caution in (1.0, 0.0):
        search.find(start, goal, caution)


def classify_pose() -> None:
    """Find the class of a pose on level ground."""
    ground = Terrain(np.zeros((60, 60)), 0.05, (0.0, 0.0))
    on_map = RoverOnMap(load_rover("lsr1"), ground, SweepOptions())
    classify_poses(on_map, np.array([[1.5, 1.5, 0.0]]))


def feel_ground() -> None:
    """Learn level ground from a rover that stands on it for three seconds."""
    ground = Terrain(np.zeros((60, 60)), 0.05, (-1.5, -1.5))
    learner = GroundLearner(load_rover("lsr1"), ground, soil="dry_sand")
    row = np.where(np.arange(WIDTH) < FORCES.start, 0.0, np.nan)
    for time in np.arange(0.0, 3.0, 0.1):
        row[TIME] = time
        learner.take(row)
    assert learner.estimate.soil is not None


def simulate() -> None:
    """Drive and brake a rover on level ground, on firm ground and on soil."""
    ground = Terrain(np.zeros((80, 80)), 0.05, (-2.0, -2.0))
    for soil in (None, "mars_simulant"):
        plant = QuasiStaticPlant(load_rover("lsr1"), ground, (0.0, 0.0, 0.0), soil=soil)
        plant.drive(0.03, 0.01, 0.02)
        plant.pull(np.full(6, 0.1), (0.03, 0.0), 0.02)
        plant.brake(0.02)
        plant.state()


def control_traction() -> None:
    """Update a traction controller with its default parameters."""
    update_traction(load_traction_settings(TractionControllerParameters()))


def update_traction(settings: TractionSettings) -> None:
    """Run all that an update of the traction controller runs, on level ground."""
    supervisor = TractionSupervisor(settings, enabled=True)
    service = supervisor.service
    joints = dict.fromkeys(JOINTS, 0.0)
    service.take_terrain(Terrain(np.zeros((50, 50)), 0.1, (-2.5, -2.5)))
    for now in (0.0, 0.01):
        service.take_joints(joints, dict.fromkeys(JOINTS, 0.1), now)
        service.take_attitude(0.0, 0.0, np.zeros(3), now)
        service.take_command(0.01, 0.0, now)
        service.take_odometry(np.zeros(4), 0.0, now)
        service.take_stop(False, now)
        supervisor.update(now)


PATH_SEARCH = (search_paths,)
"""All that searches around obstacles need."""
HAZARDS = (classify_pose,)
"""All that the hazard map needs."""
TRACTION = (control_traction,)
"""All that updates of the traction controller need."""
LEARNING = (feel_ground,)
"""All that learning the ground needs beside TRACTION."""
SIMULATION = (simulate,)
"""All that the quasi-static simulator needs."""
GROUPS = (
    (*EXACT, *UNCERTAIN, *HAZARDS, *PATH_SEARCH, *SIMULATION),
    (search_lattice, *TRACTION, *LEARNING),
)
"""All kernels. The first group compiles the model of a pose once for all that use it, which takes
two thirds of the time; the second has what needs no such model."""


LOADING_DELAY = 1.0
"""Time that a program has to itself before it loads what it needs later [s]."""


def load_kernels(
    first: Sequence[Step], behind: Sequence[Step], report: Callable[[str], object]
) -> Compilation:
    """Load kernels, and begin to load others while the program works.

    Args:
        first: What is needed at once: this function returns when it is loaded.
        behind: What is needed later. If `first` must be compiled, it is compiled meanwhile.
        report: Function that takes a line on each thing that is compiled, which takes seconds.

    Returns:
        What loads the others; to be closed when the program ends.
    """
    background, count = Compilation(behind, NICENESS), itertools.count(1)

    def tell_behind(name: str) -> None:
        report(f"compiling besides: {name}")

    def tell_first(name: str) -> None:
        background.start(tell_behind)
        report(f"compiling kernels {next(count)} of {len(first)}: {name}")

    try:
        with Compilation(first) as compilation:
            compilation.run(tell_first)
    except BaseException:  # such as KeyboardInterrupt
        background.close()
        raise
    background.start(tell_behind, LOADING_DELAY)
    return background
