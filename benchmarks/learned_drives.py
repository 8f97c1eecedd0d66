# SPDX-License-Identifier: Apache-2.0
"""Drives of all programs on rocks slicker than the planner was told, with learning or without.

Run from the repository: python -m benchmarks.learned_drives FOLDER [--learn off|use]

Simulator (MuJoCo, friction 0.45), server and controller (told 0.8) are those of
simulation.launch.py, each a process; a mission planner drives to a goal, and with `use` a ground
learner runs beside them. All go by the simulator's time. Each drive begins anew and is a line of
FOLDER/<learn>.jsonl; those that are there are not driven again. Without --learn the table of what
is there is printed. It needs the extra `bench`.
"""

import json
import signal
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
import yaml
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import QoSProfile
from std_msgs.msg import String

from benchmarks.measure import print_table
from benchmarks.processes import ROOT, NodeProcesses, open_nodes
from msg_adapters.odometry import odometry_to_pose
from msg_adapters.stamps import NANOSECONDS, stamp_to_ns
from rover_physics import Terrain, judge_path, load_rover, save_terrain
from rover_planner.parameters.traverse_server import OFF, USE
from rover_planner.ros.qos import latched_qos
from rover_planner.worlds.mars_terrain import make_mars_terrain
from support.project.launch_files import simulation_commands
from support.ros_fixtures import PATIENT, RosRun
from support.waiting import wait_until

FRICTION = 0.45
"""Friction of the ground; rover, planner and controller are told 0.8."""
SIZE, ROUGHNESS, ROCK_COVER = 12.0, 0.1, 0.05
"""Size of a field [m], RMS height difference of its relief over 1 m [m], its cover by rocks."""
DISTANCE = (2.5, 3.5)
"""Distances of goals [m]."""
SPEED = 0.08
"""Speed along a path [m/s]."""
PATIENCE = 240.0
"""Time after which a drive has not arrived, of the simulator [s]."""
SLACK = {
    "traverse_server": {"search_budget": 4.0, "time_budget": 8.0},
    "simulated_traction_controller": PATIENT | {"clock_timeout": 1.0},
}
"""Parameters that leave the programs time on a busy machine."""
STUCK_TIME, NO_PROGRESS, AWAY = 5.0, 0.1, 0.1
"""A rover is stuck that goes on for this time [s] by less than this share of the way that it is
asked to go; it is stuck again only this far [m] away."""
START_TIME = 120.0
"""Longest wait for the start of the programs [s]."""


class Ear(Node):
    """Hears how fast the rover is to go, where it is, and what was learned."""

    def __init__(self, ros: RosRun):
        super().__init__("ear", context=ros.context)
        self.rows: list[tuple[float, float, float, float, float]] = []
        """Time [s], x, y [m], yaw [rad] and commanded speed [m/s]."""
        self.friction: dict[str, float | None] = {}
        """The last estimate."""
        self._speed = 0.0
        for kind, topic, hear, qos in (
            (TwistStamped, "cmd_vel", self._hear_speed, QoSProfile(depth=1000)),
            (Odometry, "odometry", self._hear_odometry, QoSProfile(depth=1000)),
            (String, "traverse_server/ground_estimate", self._hear_estimate, latched_qos()),
        ):
            self.create_subscription(kind, topic, hear, qos)

    def _hear_speed(self, twist: TwistStamped) -> None:
        self._speed = twist.twist.linear.x

    def _hear_odometry(self, odometry: Odometry) -> None:
        x, y, _, yaw = odometry_to_pose(odometry, "map")[0].tolist()
        seconds = (stamp_to_ns(odometry.header.stamp) or 0) / NANOSECONDS
        self.rows.append((seconds, x, y, yaw, self._speed))

    def _hear_estimate(self, message: String) -> None:
        self.friction = json.loads(message.data)["friction"]


def count_stuck(rows: np.ndarray) -> int:
    """Return how often a rover got stuck; rows are those of an `Ear`."""
    times, places, asked = rows[:, 0], rows[:, 1:3], np.abs(rows[:, 4])
    ways = np.append(0.0, np.cumsum(asked[1:] * np.diff(times)))
    count, last = 0, np.full(2, np.inf)
    for k, first in enumerate(np.searchsorted(times, times - STUCK_TIME)):
        way, moved = ways[k] - ways[first], np.hypot(*(places[k] - places[first]))
        wanted = first > 0 and way > 0.5 * SPEED * STUCK_TIME
        if wanted and moved < NO_PROGRESS * way and np.hypot(*(places[k] - last)) > AWAY:
            count, last = count + 1, places[k]
    return count


def draw_drive(number: int) -> tuple[Terrain, np.ndarray, np.ndarray]:
    """Return a field, and a start and a goal (3,) where the told rover can stand."""
    field = make_mars_terrain(
        1 + number // 5, SIZE, roughness=ROUGHNESS, rock_cover=ROCK_COVER, crater_density=0.0
    )
    rng, rover = np.random.default_rng(number), load_rover("lsr1")
    while True:
        most = 0.5 * SIZE - 1.0
        x, y = rng.uniform(-most, most, 2)
        yaw, far = rng.uniform(-np.pi, np.pi), rng.uniform(*DISTANCE)
        start = np.array([x, y, yaw])
        goal = start + far * np.array([np.cos(yaw), np.sin(yaw), 0.0])
        if np.abs(goal[:2]).max() < most and all(
            judge_path(rover, field, pose[None, :])[1].traversable for pose in (start, goal)
        ):
            return field, start, goal


def drive(number: int, learn: str) -> dict[str, Any]:
    """Drive once; return what became of it."""
    field, start, goal = draw_drive(number)
    with open_nodes() as nodes:
        file = nodes.folder / "field.npz"
        save_terrain(file, field)
        start_programs(nodes, file, start, learn)
        ear = nodes.ros.spin(Ear(nodes.ros))
        wait_until(lambda: bool(ear.rows), "the simulator", START_TIME)
        place, aim = (",".join(f"{v:.3f}" for v in pose) for pose in (ear.rows[-1][1:4], goal))
        mission = nodes.start_module(
            "rover_planner.nodes.mission_planner",
            *(f"--start={place}", f"--goal={aim}", "--drive", "--json"),
        )
        begin = ear.rows[-1][0]

        def watch() -> None:
            if ear.rows[-1][0] > begin + PATIENCE:
                raise TimeoutError

        events, end = [], ""
        try:
            events = [json.loads(line) for line in mission.lines(watch)]
            end = mission.last_line()
        except TimeoutError:
            end = f"not there after {PATIENCE:.0f} s"
        rows, learned = np.array(ear.rows), ear.friction
    named = [event["event"] for event in events]
    reasons = [event["answer"]["reason"] for event in events if event["event"] == "answer"]
    drove = "driving" in named or not events
    end = end if drove else "".join(reasons)
    outcome = "arrived" if "arrived" in named else "no way on" if "no way on" in end else "stuck"
    away = np.hypot(*(rows[-1, 1:3] - goal[:2]))
    return {
        "drive": number,
        "outcome": outcome if drove else "refused",
        "times stuck": count_stuck(rows),
        "time": round(rows[-1, 0] - begin, 1),
        "from goal": round(float(away), 2),
        "learned": [round(learned[key], 2) for key in ("mean", "low", "high") if learned.get(key)],
        "end": "" if outcome == "arrived" else end,
    }


def start_programs(nodes: NodeProcesses, file: Path, start: np.ndarray, learn: str) -> None:
    """Start simulator, server and controller, and with USE a learner."""

    def write(stem: str, **values: Any) -> str:
        content = yaml.safe_load((ROOT / "config" / "parameters" / f"{stem}.yaml").read_text())
        content["/**"]["ros__parameters"] |= SLACK.get(stem, {}) | values
        copy = nodes.folder / f"{stem}.yaml"
        copy.write_text(yaml.dump(content))
        return str(copy)

    sees_all = {"sensor_range": 2.0 * SIZE, "sensor_occlusion": False, "map_rate": 0.1}
    commands = simulation_commands(
        engine="mujoco",
        terrain_file=str(file),
        speed=str(SPEED),
        use_sim_time="true",
        **{f"start_{axis}": str(v) for axis, v in zip(("x", "y", "yaw"), start, strict=True)},
        rover_simulator_parameters=write("rover_simulator", friction=FRICTION, **sees_all),
        traverse_server_parameters=write("traverse_server", learn=learn),
        traction_controller_parameters=write("simulated_traction_controller"),
    )
    for words in commands.values():
        nodes.start_module(*words[2:])
    if learn == USE:
        nodes.start("ground_learner", mark_when_stuck=True, use_sim_time=True)


def read_drives(file: Path) -> list[dict[str, Any]]:
    """Return the drives of a file, none if it is not there."""
    lines = file.read_text().splitlines() if file.exists() else []
    return [json.loads(line) for line in lines]


def print_drives(folder: Path) -> None:
    """Print what became of the drives."""
    table = []
    for learn in (OFF, USE):
        drives = read_drives(folder / f"{learn}.jsonl")
        ends = [one["outcome"] for one in drives]
        stuck = [one["times stuck"] for one in drives]
        times = [one["time"] for one in drives if one["outcome"] == "arrived"]
        counts = (ends.count(end) for end in ("arrived", "stuck", "no way on", "refused"))
        row = len(drives), *counts, np.count_nonzero(stuck), sum(stuck)
        table.append((learn, *map(str, row), f"{np.median(times):.0f}" if times else ""))
    headings = "learn", "drives", "arrived", "ended stuck", "no way on", "refused"
    more = "stuck on the way", "times stuck", "time [s]"
    print_table(f"Friction {FRICTION:g}, told 0.8", (*headings, *more), table)


def main(
    folder: Annotated[Path, typer.Argument(help="Keeps a line per drive.")],
    drives: Annotated[int, typer.Option(help="Number of drives.")] = 20,
    learn: Annotated[str, typer.Option(help="off or use; empty only prints.")] = "",
) -> None:
    """Drive, and print what became of all drives."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # its programs end with it
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / f"{learn}.jsonl"
    done = {one["drive"] for one in read_drives(file)} if learn else set(range(drives))
    for number in sorted(set(range(drives)) - done):
        result = drive(number, learn)
        with file.open("a") as lines:
            lines.write(json.dumps(result) + "\n")
        print(json.dumps(result), flush=True)
    print_drives(folder)


if __name__ == "__main__":
    typer.run(main)
