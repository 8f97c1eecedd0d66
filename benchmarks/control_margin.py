"""Drives in MuJoCo over ground that the planner calls passable with traction control.

Run from the repository:
python -m benchmarks.control_margin [--count N] [--seed S] [--workers W] [--out FILE]
It needs the extra `bench`. Its results are in docs/reliability.md.
"""

import argparse
import json
import multiprocessing
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from rover_physics.names import EQUAL, OPTIMAL
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.model import Rover
from rover_physics.rover.rover_file import load_rover
from rover_physics.rover.steered_drive import SteeredDrive
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.judge import judge_path
from rover_planner.parameters.shared import CONTROL_MARGIN
from rover_planner.parameters.traction_controller import TractionControllerParameters
from rover_planner.simulator.mujoco_rover import MujocoRover
from rover_planner.simulator.path_follower import PathFollower
from rover_planner.simulator.second_try import SecondTry
from rover_planner.traction.settings import load_traction_settings
from rover_planner.traction.traction_service import TractionService
from support.reference_drives import drive_ground, drive_path, unlimited
from support.rough_grounds import bouldered, fractal

PERIOD = 0.02
"""Period of the controller [s]."""
SPEED = 0.06
"""Speed of the drives [m/s]."""
START, END = -1.2, 1.2
"""x of the body's origin at the start and at the end of a drive [m]."""
LOOK_AHEAD = 0.5
"""Look-ahead distance of the path follower [m]."""
MAX_DURATION = 5.0 * (END - START) / SPEED
"""Time after which a rover that still moves has failed [s]."""
MAX_TILT, MAX_OFFSET = 1.2, 1.0
"""Tilt [rad] and distance from the path [m] from which a rover is lost."""
MAP, MOTION = "map", "motion"
"""Sources of the contact angles."""
SIZES = {
    "step": (0.05, 0.25),
    "bump_one_side": (0.05, 0.25),
    "ditch": (0.1, 0.7),
    "slope": (8.0, 32.0),
    "cross_slope": (8.0, 32.0),
    "rocks": (0.05, 0.16),
    "relief": (0.05, 0.14),
}
"""Smallest and largest height or width [m], angle [deg] or height of rocks and relief [m]."""
FRICTIONS = 0.35, 1.0
"""Smallest and largest friction coefficient."""
TORQUES = 0.3, 2.5
"""Smallest and largest torque limit [N m]; their logarithm is uniform."""
MARGINS = tuple(round(0.02 * k, 2) for k in range(26))
"""Control margins that are tried."""
BATCH = 40
"""Cases that are drawn at once."""
SHOWN = (0.0, 0.04, 0.08, 0.1, 0.12, 0.16, 0.2, 0.24, 0.3)
"""Control margins in the table."""


@dataclass(frozen=True)
class Case:
    """A ground to drive over along +x, with a friction and a torque limit."""

    kind: str
    """One of SIZES."""
    size: float
    """Size of the obstacle, as in SIZES."""
    friction: float
    """Friction coefficient."""
    max_torque: float
    """Largest torque of a wheel [N m]."""
    seed: int = 0
    """Seed of rocks and relief."""

    @property
    def label(self) -> str:
        """Kind, size, friction and torque."""
        return f"{self.kind} {self.size:.3g}, mu {self.friction:.2f}, {self.max_torque:.2f} N m"


@dataclass(frozen=True)
class Drive:
    """Result of a drive."""

    passed: bool
    """Whether the rover reached the end."""
    end: float
    """x of the body's origin at the end [m]."""
    duration: float
    """Duration [s]."""
    retries: int
    """How often the rover backed off and tried again."""


def draw_case(rng: np.random.Generator) -> Case:
    """Draw a ground, a friction and a torque limit."""
    kind = str(rng.choice(list(SIZES)))
    low, high = np.log(TORQUES)
    return Case(
        kind=kind,
        size=float(rng.uniform(*SIZES[kind])),
        friction=float(rng.uniform(*FRICTIONS)),
        max_torque=float(np.exp(rng.uniform(low, high))),
        seed=int(rng.integers(1, 1_000_000)),
    )


def make_ground(case: Case) -> Terrain:
    """Return the ground of a case."""
    if case.kind == "rocks":
        return bouldered(case.seed, highest=case.size)
    if case.kind == "relief":
        return fractal(case.seed, roughness=case.size)
    return drive_ground(case.kind, case.size)


def find_margin(case: Case, margins: Sequence[float] = MARGINS) -> float:
    """Return the largest control margin that a drive keeps.

    NaN if it does not need traction control, negative if it is impassable with it, too. The
    rover has only the limits that MuJoCo knows.
    """
    rover, ground, path = unlimited(load_rover("lsr1")), make_ground(case), drive_path()
    options = SweepOptions(friction=case.friction, max_torque=case.max_torque, policy=EQUAL)
    if judge_path(rover, ground, path, options)[1].traversable:
        return float("nan")

    def passes(margin: float) -> bool:
        asked = replace(options, policy=OPTIMAL, control_margin=margin)
        return judge_path(rover, ground, path, asked)[1].traversable

    kept = -1.0
    low, high = 0, len(margins)
    while low < high:
        middle = (low + high) // 2 if low else 0
        if passes(margins[middle]):
            kept, low = margins[middle], middle + 1
        else:
            high = middle
    return kept


def draw_promised(
    pool: ProcessPoolExecutor, count: int, seed: int, least: float = 0.0
) -> dict[Case, float]:
    """Return `count` cases that are passable with traction control, with their margins.

    `least` is the least margin of a case.
    """
    rng, margins = np.random.default_rng(seed), {}
    while True:
        cases = [draw_case(rng) for _ in range(BATCH)]
        for case, margin in zip(cases, pool.map(find_margin, cases), strict=True):
            if margin >= least:
                margins[case] = margin
            if len(margins) == count:
                return margins


def drive(case: Case, source: str = MAP) -> Drive:
    """Drive the rover lsr1 over the ground of a case with the traction controller.

    Args:
        case: The ground, friction and torque limit.
        source: MAP or MOTION, where the contact angles come from.
    """
    ground, plant = _place_rover(case)
    parameters = TractionControllerParameters(friction=case.friction, max_torque=case.max_torque)
    service = TractionService(load_traction_settings(parameters))
    if source == MAP:
        service.take_terrain(ground)
    path = np.array([[START, 0.0, 0.0], [END + LOOK_AHEAD, 0.0, 0.0]])
    follower, steered = SecondTry(PathFollower(path, LOOK_AHEAD)), SteeredDrive(plant.rover)
    while plant.time < MAX_DURATION and plant.pose[0] < END:
        now, pose = plant.time, plant.pose
        steering = follower.steer(pose[[0, 1, 3]], SPEED, now)
        if follower.given_up or plant.tilt > MAX_TILT or abs(pose[1]) > MAX_OFFSET:
            break
        service.take_joints(plant.joint_positions, plant.joint_velocities, now)
        service.take_attitude(*plant.attitude, plant.body_rates, now)
        service.take_command(*steering, now)
        service.take_odometry(pose, 0.0, now)
        plant.steer(steered.aim(*steering).angles)
        plant.step(service.update(now).torques, PERIOD)
    end = float(plant.pose[0])
    return Drive(end >= END, end, plant.time, follower.retries)


def _place_rover(case: Case) -> tuple[Terrain, MujocoRover]:
    """Return the ground and the rover at its start, with the torque limit of the case."""
    rover: Rover = load_rover("lsr1")
    rover = replace(rover, wheel=replace(rover.wheel, max_torque=case.max_torque))
    ground = make_ground(case)
    return ground, MujocoRover(rover, ground, (START, 0.0, 0.0), case.friction)


def drive_all(pool: ProcessPoolExecutor, cases: Sequence[Case], sources: Sequence[str]) -> dict:
    """Drive all cases with contact angles from each source."""
    jobs = [(case, source) for case in cases for source in sources]
    futures = {pool.submit(drive, *job): job for job in jobs}
    with Progress(console=Console(stderr=True)) as progress:
        task = progress.add_task("drive", total=len(jobs))
        for _ in as_completed(futures):
            progress.advance(task)
    return {job: future.result() for future, job in futures.items()}


def show_margins(margins: dict[Case, float], drives: dict, sources: Sequence[str]) -> Table:
    """Return a table of the share of drives that passed, by control margin."""
    table = Table(title="LSR-1 in MuJoCo: passed, of drives that keep a control margin")
    table.add_column("control margin")
    for source in sources:
        table.add_column(f"contact angles from {source}", justify="right")
    for margin in SHOWN:
        kept = [case for case, left in margins.items() if left >= margin]
        cells = []
        for source in sources:
            passed = sum(drives[case, source].passed for case in kept)
            share = f" ({100.0 * passed / len(kept):.1f} %)" if kept else ""
            cells.append(f"{passed} of {len(kept)}{share}")
        table.add_row(f"{margin:.2f}", *cells)
    return table


def show_failures(margins: dict[Case, float], drives: dict) -> Table:
    """Return a table of the drives that failed, least margin first."""
    table = Table(title="Drives that did not pass")
    for heading in ("case", "seed", "margin", "contact angles", "x [m]", "time [s]"):
        table.add_column(heading)
    failed = [(margins[case], case, source) for (case, source) in drives]
    for margin, case, source in sorted(failed, key=lambda row: row[0]):
        row = drives[case, source]
        if not row.passed:
            where = f"{row.end:.2f}", f"{row.duration:.0f}"
            table.add_row(case.label, str(case.seed), f"{margin:.2f}", source, *where)
    return table


def main() -> None:
    """Draw, judge and drive; print tables and write JSON."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--count", type=int, default=100, help="number of drives")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--least", type=float, default=0.0, help="least control margin")
    parser.add_argument("--workers", type=int, default=2, help="number of processes")
    parser.add_argument("--sources", nargs="+", choices=(MAP, MOTION), default=[MAP, MOTION])
    parser.add_argument("--out", type=Path, default=Path("bench_output/control_margin.json"))
    arguments = parser.parse_args()
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(arguments.workers, mp_context=context) as pool:
        margins = draw_promised(pool, arguments.count, arguments.seed, arguments.least)
        drives = drive_all(pool, list(margins), arguments.sources)
    console = Console()
    console.print(show_failures(margins, drives))
    console.print(show_margins(margins, drives, arguments.sources))
    console.print(f"The default of control_margin is {CONTROL_MARGIN:g}.")
    rows = [
        asdict(case) | {"margin": margins[case], "source": source} | asdict(row)
        for (case, source), row in drives.items()
    ]
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    arguments.out.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
