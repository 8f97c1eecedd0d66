"""Closed-loop drives in MuJoCo with speed servos, equal torques and the quadratic program.

Run from the repository: python -m benchmarks.traction [--quick] [--out FOLDER]
It needs the extra `bench`. Its results are in docs/traction.md.
"""

import argparse
import json
import multiprocessing
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from rover_physics.names import EQUAL, OPTIMAL
from rover_physics.rover.rover_file import load_rover
from rover_physics.rover.steered_drive import SteeredDrive, WheelAims
from rover_physics.terrain.grid import Terrain
from rover_planner.parameters.traction_controller import TractionControllerParameters
from rover_planner.simulator.mujoco_rover import TIMESTEP, MujocoRover
from rover_planner.simulator.path_follower import PathFollower
from rover_planner.traction.settings import load_traction_settings
from rover_planner.traction.traction_service import TractionService
from support.reference_drives import drive_ground
from support.rough_grounds import bouldered, fractal

PERIOD = 0.02
"""Period of the controllers [s]."""
SPEED = 0.06
"""Speed of the drives [m/s]: twice the rover's nominal speed, to halve the run time."""
START, END = -1.2, 1.2
"""x of the body's origin at the start and at the end of a drive [m]."""
LOOK_AHEAD = 0.5
"""Look-ahead distance of the path follower that steers [m]."""
MAX_DURATION_RATIO = 2.0
"""Time after which a rover counts as stuck, as a multiple of the time at SPEED."""
MAX_TILT = 1.2
"""Tilt from which a rover counts as tipped over [rad]."""
MAX_OFFSET = 1.0
"""Distance from the x axis from which a rover counts as lost [m]."""
MIN_LOAD = 0.02
"""Load above which the utilisation of a wheel counts, in sixths of the weight."""
SERVO_CONTROLLER, EQUAL_CONTROLLER = "servo", "equal"
MOTION_CONTROLLER, MAP_CONTROLLER = "optimal", "optimal, map"
DROOP_CONTROLLER = "servo with droop"
CONTROLLERS = (SERVO_CONTROLLER, EQUAL_CONTROLLER, MOTION_CONTROLLER, MAP_CONTROLLER)
"""Speed servos, equal torques, and the QP with contact angles from motion or from the map. The
servos have an integral part; those with droop, of benchmarks.servos, have none."""


@dataclass(frozen=True)
class Obstacle:
    """A ground to drive over along +x."""

    kind: str
    """step, bump_one_side, ditch, slope, rocks or relief."""
    size: float
    """Height or width [m], angle [deg], or seed of rocks and relief."""
    friction: float
    """Friction coefficient."""

    @property
    def label(self) -> str:
        """Kind, size and friction."""
        return f"{self.kind} {self.size:g}, mu {self.friction:g}"


@dataclass(frozen=True)
class Drive:
    """Result of a drive; means are over time and wheels, up to the end or where it got stuck."""

    passed: bool
    """Whether the rover reached the end."""
    end: float
    """x of the body's origin at the end [m]."""
    duration: float
    """Duration [s]."""
    mean_utilisation: float
    """Mean over time of the largest friction utilisation of the six wheels."""
    peak_utilisation: float
    """95th percentile over time of the largest friction utilisation."""
    slip: float
    """Distance that a tread slid over the ground [m], mean of the six wheels."""
    torque: float
    """Mean absolute wheel torque [N m]."""
    torque_squared: float
    """Mean square of a wheel's torque [(N m)^2]."""
    energy: float
    """Mechanical work of the motors [J]; negative power counts as zero."""


class Steering:
    """Follows the x axis: what a path follower commands, and what this asks of the wheels."""

    def __init__(self, plant: MujocoRover):
        """Prepare for a rover at the start of its path."""
        path = np.array([[START, 0.0, 0.0], [END + LOOK_AHEAD, 0.0, 0.0]])
        self._follower, self._drive = PathFollower(path, LOOK_AHEAD), SteeredDrive(plant.rover)
        self._plant = plant

    def steer(self) -> tuple[float, float]:
        """Steer; return the speed [m/s] and the yaw rate [rad/s] that are commanded."""
        return self._aim()[0]

    def steer_and_roll(self) -> np.ndarray:
        """Steer; return the rates (6,) of the wheels [rad/s] in the commanded motion."""
        aims = self._aim()[1]
        share = self._drive.share(self._plant.steering_angles, aims.angles)
        return share * aims.speeds / self._plant.rover.wheel.radius

    def _aim(self) -> tuple[tuple[float, float], WheelAims]:
        command = self._follower.steer(self._plant.pose[[0, 1, 3]], SPEED)
        aims = self._drive.aim(*command)
        self._plant.steer(aims.angles)
        return command, aims


Controller = Callable[[], np.ndarray]


def make_controller(
    name: str, plant: MujocoRover, obstacle: Obstacle, ground: Terrain
) -> Controller:
    """Return a function that advances the plant by PERIOD and returns its torques (6,) [N m]."""
    steering = Steering(plant)
    if name == SERVO_CONTROLLER:
        return lambda: plant.servo(steering.steer_and_roll(), PERIOD)
    if name == DROOP_CONTROLLER:
        droop = plant.rover.wheel.servo_droop
        return lambda: plant.servo_with_droop(steering.steer_and_roll(), droop, PERIOD)
    policy = EQUAL if name == EQUAL_CONTROLLER else OPTIMAL
    parameters = TractionControllerParameters(policy=policy, friction=obstacle.friction)
    service = TractionService(load_traction_settings(parameters))
    if name == MAP_CONTROLLER:
        service.take_terrain(ground)

    def control() -> np.ndarray:
        now = plant.time
        service.take_joints(plant.joint_positions, plant.joint_velocities, now)
        service.take_attitude(*plant.attitude, plant.body_rates, now)
        service.take_command(*steering.steer(), now)
        service.take_odometry(plant.pose, 0.0, now)
        torques = service.update(now).torques
        plant.step(torques, PERIOD)
        return torques

    return control


def drive(
    obstacle: Obstacle, name: str, trace: list | None = None, timestep: float = TIMESTEP
) -> Drive:
    """Drive the rover lsr1 over an obstacle with a controller.

    If `trace` is given, each period appends a row to it: time [s], x [m], loads (6) [N],
    torques (6) [N m], peak utilisation.
    """
    rover, ground = replace(load_rover("lsr1"), nominal_speed=SPEED), make_ground(obstacle)
    plant = MujocoRover(rover, ground, (START, 0.0, 0.0), obstacle.friction, timestep)
    control = make_controller(name, plant, obstacle, ground)
    sums, peaks = np.zeros(4), []
    while plant.time < MAX_DURATION_RATIO * (END - START) / SPEED and plant.pose[0] < END:
        torques = control()
        if plant.tilt > MAX_TILT or abs(plant.pose[1]) > MAX_OFFSET:
            break
        contacts = plant.measure_contacts()
        sums[0] += contacts.slip_speeds.mean() * PERIOD
        sums[1] += np.abs(torques).mean() * PERIOD
        sums[2] += (torques**2).mean() * PERIOD
        sums[3] += np.clip(torques * plant.wheel_rates, 0.0, None).sum() * PERIOD
        held = contacts.loads > MIN_LOAD * rover.weight / 6.0
        used = contacts.shears[held] / (obstacle.friction * contacts.loads[held])
        peaks.append(float(used.max(initial=0.0)))
        if trace is not None:
            trace.append((plant.time, plant.pose[0], *contacts.loads, *torques, peaks[-1]))
    if not peaks:
        raise ValueError(f"the rover cannot stand at the start of {obstacle.label}")
    return Drive(
        passed=bool(plant.pose[0] >= END),
        end=float(plant.pose[0]),
        duration=plant.time,
        mean_utilisation=float(np.mean(peaks)),
        peak_utilisation=float(np.percentile(peaks, 95)),
        slip=float(sums[0]),
        torque=float(sums[1] / plant.time),
        torque_squared=float(sums[2] / plant.time),
        energy=float(sums[3]),
    )


def make_ground(obstacle: Obstacle) -> Terrain:
    """Return the ground of an obstacle."""
    if obstacle.kind == "rocks":
        return bouldered(int(obstacle.size), highest=0.08)
    if obstacle.kind == "relief":
        return fractal(int(obstacle.size), roughness=0.09)
    return drive_ground(obstacle.kind, obstacle.size)


OBSTACLES = (
    *(Obstacle("step", size, mu) for size, mu in ((0.08, 0.6), (0.10, 0.8), (0.13, 0.8))),
    Obstacle("step", 0.16, 1.0),
    *(Obstacle("bump_one_side", size, mu) for size, mu in ((0.06, 0.4), (0.10, 0.6), (0.14, 0.8))),
    *(Obstacle("ditch", size, mu) for size, mu in ((0.12, 0.6), (0.30, 0.8), (0.60, 1.0))),
    *(Obstacle("slope", size, mu) for size, mu in ((15.0, 0.4), (20.0, 0.6), (25.0, 0.8))),
    *(Obstacle("rocks", seed, mu) for seed, mu in ((1, 0.4), (2, 0.6), (3, 0.8), (4, 1.0))),
    *(Obstacle("relief", seed, mu) for seed, mu in ((1, 0.4), (2, 0.6), (3, 0.8))),
)  # fmt: skip
"""Obstacles of the benchmark: frictions from 0.4 to 1.0."""
ROUGH = ("rocks", "relief")
"""Kinds of rough ground."""
QUICK_STEP = 5
"""With --quick, every so many-th obstacle is driven over."""


def drive_all(obstacles: Sequence[Obstacle]) -> dict[tuple[Obstacle, str], Drive]:
    """Drive over all obstacles with all controllers, using one process per core."""
    jobs = [(obstacle, name) for obstacle in obstacles for name in CONTROLLERS]
    context = multiprocessing.get_context("spawn")
    with (
        ProcessPoolExecutor(mp_context=context) as pool,
        Progress(console=Console(stderr=True)) as progress,
    ):
        task = progress.add_task("drive", total=len(jobs))
        futures = [pool.submit(drive, *job) for job in jobs]
        for _ in as_completed(futures):
            progress.advance(task)
        return {job: future.result() for job, future in zip(jobs, futures, strict=True)}


def compare(drives: dict[tuple[Obstacle, str], Drive], kinds: Sequence[str]) -> dict[str, dict]:
    """Return, by controller, sums over the obstacles that all controllers passed."""
    obstacles = [
        obstacle
        for obstacle, name in drives
        if name == SERVO_CONTROLLER and obstacle.kind in kinds
    ]
    common = [o for o in obstacles if all(drives[o, name].passed for name in CONTROLLERS)]
    sums = {}
    for name in CONTROLLERS:
        rows = [drives[obstacle, name] for obstacle in common]
        lost = [
            o.label
            for o in obstacles
            if drives[o, SERVO_CONTROLLER].passed and not drives[o, name].passed
        ]
        sums[name] = {
            "passed": sum(drives[obstacle, name].passed for obstacle in obstacles),
            "of": len(obstacles),
            "lost": lost,
            "slip": sum(row.slip for row in rows),
            "torque": float(np.mean([row.torque for row in rows])) if rows else float("nan"),
            "energy": sum(row.energy for row in rows),
            "utilisation": float(np.mean([row.mean_utilisation for row in rows])) if rows else 0.0,
        }
    return sums


def show_drives(drives: dict[tuple[Obstacle, str], Drive]) -> Table:
    """Return a table with one row per drive."""
    table = Table(title="LSR-1 in MuJoCo, 2.4 m at 6 cm/s")
    headings = ("obstacle", "controller", "end [m]", "utilisation mean", "95 %", "slip [m]",
                "torque [N m]", "energy [J]")  # fmt: skip
    for heading in headings:
        table.add_column(heading, justify="left" if heading in headings[:2] else "right")
    for (obstacle, name), row in drives.items():
        table.add_row(
            obstacle.label if name == SERVO_CONTROLLER else "", name,
            "passed" if row.passed else f"{row.end:.2f}", f"{row.mean_utilisation:.2f}",
            f"{row.peak_utilisation:.2f}", f"{row.slip:.3f}", f"{row.torque:.3f}",
            f"{row.energy:.1f}",
        )  # fmt: skip
    return table


def show_sums(sums: dict[str, dict], title: str) -> Table:
    """Return a table with one row per controller, with its differences from the servos."""
    table = Table(title=title)
    headings = ("controller", "passed", "lost", "slip [m]", "torque [N m]", "energy [J]",
                "utilisation")  # fmt: skip
    for heading in headings:
        table.add_column(heading, justify="left" if heading in ("controller", "lost") else "right")
    base = sums[SERVO_CONTROLLER]

    def against(row: dict, key: str, digits: int) -> str:
        change = 100.0 * (row[key] / base[key] - 1.0) if base[key] else 0.0
        return f"{row[key]:.{digits}f} ({change:+.0f} %)"

    for name, row in sums.items():
        table.add_row(
            name, f"{row['passed']} of {row['of']}", ", ".join(row["lost"]),
            against(row, "slip", 3), against(row, "torque", 3), against(row, "energy", 1),
            against(row, "utilisation", 2),
        )  # fmt: skip
    return table


def draw_sums(sums: dict[str, dict], picture: Path) -> None:
    """Draw slip, torque, energy and utilisation of the controllers relative to the servos."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    keys = ("slip", "torque", "energy", "utilisation")
    figure, axes = pyplot.subplots(figsize=(7.0, 3.2), layout="constrained")
    width = 0.8 / len(CONTROLLERS)
    colours = ("#999999", "#e69f00", "#56b4e9", "#0072b2")
    for k, (name, colour) in enumerate(zip(CONTROLLERS, colours, strict=True)):
        shares = [sums[name][key] / sums[SERVO_CONTROLLER][key] for key in keys]
        axes.bar(np.arange(len(keys)) + k * width, shares, width, label=name, color=colour)
    axes.set_xticks(np.arange(len(keys)) + 1.5 * width)
    axes.set_xticklabels(("slip distance", "torque effort", "energy", "utilisation"))
    axes.set_ylabel("share of the speed servos'")
    figure.legend(loc="outside upper center", ncols=len(CONTROLLERS), frameon=False)
    figure.savefig(picture, dpi=150)


def main() -> None:
    """Run the drives, print tables, and write JSON and a picture."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--quick", action="store_true", help=f"only every {QUICK_STEP}th obstacle")
    parser.add_argument("--out", type=Path, default=Path("bench_output"))
    arguments = parser.parse_args()
    drives = drive_all(OBSTACLES[::QUICK_STEP] if arguments.quick else OBSTACLES)
    kinds = tuple(dict.fromkeys(obstacle.kind for obstacle, _ in drives))
    everything, rough = compare(drives, kinds), compare(drives, ROUGH)
    console = Console()
    console.print(show_drives(drives))
    console.print(show_sums(everything, "All obstacles that all controllers passed"))
    console.print(show_sums(rough, "Rocks and relief that all controllers passed"))
    arguments.out.mkdir(parents=True, exist_ok=True)
    rows = [asdict(o) | {"controller": name} | asdict(row) for (o, name), row in drives.items()]
    result = {"drives": rows, "all": everything, "rough": rough}
    (arguments.out / "traction.json").write_text(json.dumps(result, indent=1))
    draw_sums(everything, arguments.out / "traction.png")


if __name__ == "__main__":
    main()
