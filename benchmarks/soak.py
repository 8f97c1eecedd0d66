# SPDX-License-Identifier: Apache-2.0
"""A soak: all programs drive a rover to random goals, on a busy machine, and are killed in turn.

Run from the repository: python -m benchmarks.soak [--minutes 60] [--load 4] [--kill-every 120]
[--step-every 0]

Simulator, server and controller are those of simulation.launch.py, with a page and a mission
planner beside them. Every so often one of them is killed, and the friction that the server assumes
changes. With --step-every all have the time of /clock, which is stepped by 5 s, ahead and back in
turn. The report has the drives done, the faults by cause, memory and latency at start and end, and
the torques that were heard while the controller was to rest.
"""

import contextlib
import itertools
import json
import os
import re
import signal
import time
from collections import Counter
from statistics import median
from typing import Annotated

import numpy as np
import typer
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray, String

from benchmarks.processes import (
    ROOT,
    Client,
    LostAnswerError,
    NodeProcesses,
    memory_of,
    open_nodes,
)
from msg_adapters.odometry import odometry_to_pose
from rover_physics import Terrain, save_terrain
from rover_planner.demo.child_process import ChildProcess
from rover_planner.ros.qos import latched_qos, sensor_qos, topic_qos
from rover_planner.worlds.mars_terrain import make_mars_terrain
from support.project.launch_files import simulation_commands
from support.ros_fixtures import RosRun
from support.waiting import wait_until

START_TIME = 300.0
"""Longest wait for the start of all programs [s]."""
FLIGHT = 0.1
"""Age of a stop from which no torque is on its way any more [s]."""
PATIENCE = 10.0
"""Longest wait for an answer [s]."""
REACH = 3.0
"""Largest distance of a goal [m]."""
PARAMETERS = ROOT / "config" / "parameters" / "simulated_traction_controller.yaml"
RESTS = "    rest_policy: brake\n"
"""Line of the controller's parameters besides: torques are zero when it rests."""
MISSION, PAGE, CLOCK = "mission_planner", "view", "clock"
SIM_TIME = ["--ros-args", "-p", "use_sim_time:=true"]


class Ear(Node):
    """Hears pose, torques and states, and counts the faults by cause."""

    def __init__(self, ros: RosRun):
        super().__init__("ear", context=ros.context)
        self.pose = np.full(3, np.nan)
        self.faults: Counter[str] = Counter()
        self.torques_at_rest = 0
        self._rests_since, self._fault = np.inf, ""
        for kind, topic, hear, qos in (
            (Odometry, "odometry", self._hear_odometry, sensor_qos()),
            (String, "traction_controller/state", self._hear_state, latched_qos()),
            (Float64MultiArray, "traction_controller/commands", self._hear_torques, topic_qos()),
            (DiagnosticArray, "/diagnostics", self._hear_diagnostics, topic_qos()),
        ):
            self.create_subscription(kind, topic, hear, qos)

    def _hear_odometry(self, odometry: Odometry) -> None:
        self.pose = odometry_to_pose(odometry, "map")[0][[0, 1, 3]]

    def _hear_state(self, state: String) -> None:
        self._rests_since = np.inf if state.data == "driving" else time.monotonic()

    def _hear_torques(self, message: Float64MultiArray) -> None:
        rests = time.monotonic() - self._rests_since > FLIGHT
        self.torques_at_rest += rests and any(message.data)

    def _hear_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name.startswith("traction_controller"):
                fault = re.sub(r"[-\d.]+", "#", status.message) if status.level == b"\2" else ""
                self.faults[fault] += bool(fault) and fault != self._fault
                self._fault = fault


class Programs:
    """The programs by name; each can be killed and started again."""

    def __init__(self, nodes: NodeProcesses, ground: Terrain, step_every: float):
        terrain, parameters = nodes.folder / "ground.npz", nodes.folder / "controller.yaml"
        save_terrain(terrain, ground)
        parameters.write_text(PARAMETERS.read_text() + RESTS)
        commands = simulation_commands(
            terrain_file=str(terrain),
            speed="0.08",
            use_sim_time=str(step_every > 0.0),
            traction_controller_parameters=str(parameters),
        )
        self._options = SIM_TIME if step_every > 0.0 else []
        self._nodes = nodes
        self._modules = {name: words[2:] for name, words in commands.items()}  # behind python -m
        page = [PAGE, "lsr1", str(terrain), "--follow", "--port", "0"]
        self._modules[PAGE] = ["rover_planner", *page]
        if step_every > 0.0:
            self._modules[CLOCK] = ["benchmarks.stepped_clock", str(step_every)]
        self._running: dict[str, ChildProcess] = {}
        for name in self._modules:
            self.start(name)

    def start_mission(self, *words: str) -> None:
        """Start a mission planner."""
        self.start(MISSION, ["rover_planner.nodes.mission_planner", *words, *self._options])

    def start(self, name: str, module: list[str] | None = None) -> None:
        """Start a program, with its module and words or others."""
        self._running[name] = self._nodes.start_module(*(module or self._modules[name]))

    def kill(self, name: str) -> None:
        """Kill a program."""
        if self.exit_code(name) is None:
            os.kill(self._running[name].pid, signal.SIGKILL)

    def exit_code(self, name: str) -> int | None:
        """Return the exit code of a program, None while it runs."""
        return self._running[name].exit_code

    def memory(self) -> dict[str, float]:
        """Return the memory [MB] of each program that runs."""
        return {name: memory_of(child) for name, child in self._running.items() if child.running}


def run_soak(
    minutes: float, load: int, kill_every: float, step_every: float, seed: int
) -> dict[str, object]:
    """Run a soak; return its report."""
    rng = np.random.default_rng(seed)
    ground = make_mars_terrain(seed, 24.0, 0.05, rock_cover=0.01, crater_density=0.0)
    with open_nodes() as nodes:
        for _ in range(load):
            nodes.start_module("timeit", "-n", str(10**12), "pass")
        programs, ear = Programs(nodes, ground, step_every), nodes.ros.spin(Ear(nodes.ros))
        client = nodes.client("soak")
        wait_until(lambda: np.isfinite(ear.pose).all(), "the simulator", START_TIME)
        client.connect()
        return _drive(programs, ear, client, ground, rng, (minutes, kill_every))


def _drive(
    programs: Programs,
    ear: Ear,
    client: Client,
    ground: Terrain,
    rng: np.random.Generator,
    times: tuple[float, float],
) -> dict[str, object]:
    """Drive, kill and change until the end; return the report."""
    ear.faults.clear()
    first = programs.memory(), _latency(client, ear)
    end, drives, kills = time.monotonic() + 60.0 * times[0], Counter(), Counter()
    victims = itertools.cycle(("traverse_server", "traction_controller", PAGE, MISSION,
                               "rover_simulator"))  # fmt: skip
    next_event = time.monotonic() + (times[1] or np.inf)
    _start_mission(programs, ear, rng)
    while time.monotonic() < end:
        time.sleep(0.5)
        code = programs.exit_code(MISSION)
        if code is not None:
            drives[_WORDS.get(code, f"exit code {code}")] += 1
            _start_mission(programs, ear, rng)
        if time.monotonic() > next_event:
            next_event += times[1]
            victim = next(victims)
            kills[victim] += 1
            programs.kill(victim)
            time.sleep(1.0)
            if victim != MISSION:
                programs.start(victim)
            _change(client, rng)
    return {
        "minutes": times[0],
        "drives": dict(drives),
        "kills": dict(kills),
        "faults": {cause: count for cause, count in ear.faults.items() if count},
        "torques at rest": ear.torques_at_rest,
        "memory at start [MB]": first[0],
        "memory at end [MB]": programs.memory(),
        "answer at start [ms]": first[1],
        "answer at end [ms]": _latency(client, ear),
    }


_WORDS = {0: "arrived", 1: "ended with a reason", 3: "not traversable", -9: "killed"}
"""Ends of a mission by exit code."""


def _start_mission(programs: Programs, ear: Ear, rng: np.random.Generator) -> None:
    """Send the rover to a goal near it, towards the middle of the ground."""
    x, y, yaw = ear.pose
    towards = np.arctan2(-y, -x) if np.hypot(x, y) > 2.0 * REACH else rng.uniform(-np.pi, np.pi)
    bearing = towards + rng.uniform(-0.5, 0.5)
    far = rng.uniform(0.5, 1.0) * REACH
    start = f"--start={x:.3f},{y:.3f},{yaw:.3f}"
    goal = f"--goal={x + far * np.cos(bearing):.3f},{y + far * np.sin(bearing):.3f},{bearing:.3f}"
    programs.start_mission(start, goal, "--drive")


def _change(client: Client, rng: np.random.Generator) -> None:
    """Change the friction that the server assumes: all that is watched is judged again."""
    try:
        client.set_parameter("friction", float(rng.uniform(0.6, 0.8)))
    except LostAnswerError:
        return  # it is the server that was killed


def _latency(client: Client, ear: Ear) -> float:
    """Return the median time of a question of 1 m [ms]."""
    taken = []
    for _ in range(10):
        begin = time.monotonic()
        x, y, yaw = ear.pose.tolist()
        with contextlib.suppress(LostAnswerError):
            client.plan((x, y, yaw), (x + np.cos(yaw), y + np.sin(yaw), yaw), PATIENCE)
        taken.append(1e3 * (time.monotonic() - begin))
    return median(taken)


def main(
    minutes: Annotated[float, typer.Option(help="Length in minutes.")] = 60.0,
    load: Annotated[int, typer.Option(help="Processes that do nothing but compute.")] = 4,
    kill_every: Annotated[float, typer.Option(help="Time between kills in s; 0: none.")] = 120.0,
    step_every: Annotated[
        float, typer.Option(help="Time between clock steps in s; 0: none.")
    ] = 0.0,
    seed: Annotated[int, typer.Option(help="Seed of ground and goals.")] = 1,
) -> None:
    """Run a soak and print its report as JSON."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # its programs end with it
    print(json.dumps(run_soak(minutes, load, kill_every, step_every, seed), indent=2))


if __name__ == "__main__":
    typer.run(main)
