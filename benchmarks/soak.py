# SPDX-License-Identifier: Apache-2.0
"""A soak: all programs drive a rover to random goals, on a busy machine, and are disturbed.

Run from the repository: python -m benchmarks.soak [--minutes 40] [--calm 20] [--load 2]

Simulator, server and controller are those of simulation.launch.py, with a page and a mission
planner beside them. Every so often, in turn, one of them is killed; the server gets another map
and friction; and the system clock of all is stepped by 5 s, ahead or back. A calm time follows, in
which nothing is disturbed. The report has the drives done, the faults by cause, memory and latency
before, between and after, the load of the machine, and the torques that were heard while the
controller was to rest.
"""

import contextlib
import itertools
import json
import os
import re
import signal
import time
from collections import Counter
from pathlib import Path
from statistics import median
from typing import Annotated, Any

import numpy as np
import typer
import yaml
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
from nav_msgs.srv import LoadMap
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Float64MultiArray, String

from benchmarks.processes import START_TIME, STOP_TIMEOUT, NodeProcesses, memory_of, open_nodes
from benchmarks.stepped_clock import SteppedClock
from msg_adapters.sensors import odometry_to_pose
from rover_physics import save_terrain
from rover_planner.demo.child_process import ChildProcess
from rover_planner.ros.qos import SENSOR_QOS, TOPIC_QOS
from rover_planner.worlds.mars_terrain import make_mars_terrain
from support.project.checkout import TOP
from support.ros_fixtures import RosRun, finish
from support.waiting import wait_until

FLIGHT = 0.1
"""Time for which a controller that comes to rest may still send torques [s]."""
QUEUE = 1000
"""States and torques that wait to be heard; a lost state would make torques count."""
PATIENCE = 10.0
"""Longest wait for an answer [s]."""
PRIORITY = 50
"""Real-time priority of simulator and controller, as the drivers of a rover have."""
REACH = 3.0
"""Largest distance of a goal [m]."""
PARAMETERS = TOP / "config" / "parameters"
MISSION, PAGE = "mission_planner", "view"
VICTIMS = ("traverse_server", "traction_controller", PAGE, MISSION, "rover_simulator")
"""Programs that are killed in turn."""
ROCKS = (0.01, 0.005, 0.015)
"""Cover by rocks of the maps, all of one relief; the first is the ground."""
LOOPBACK = {
    "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET",
    "FASTRTPS_DEFAULT_PROFILES_FILE": str(TOP / "config" / "fast_dds_loopback.xml"),
}
"""Environment in which programs do not wait for each other's shared memory, as on a robot."""
STEPS = (5, 0)
"""What the system clock is ahead by, in turn [s]."""


class Ear(Node):
    """Hears pose, torques and states, and counts the faults by cause."""

    def __init__(self, ros: RosRun):
        super().__init__("ear", context=ros.context)
        self.pose = np.full(3, np.nan)
        self.faults: Counter[str] = Counter()
        self._fault, self._sent = "", list[tuple[float, str, bool]]()
        torques = QoSProfile(depth=QUEUE)
        states = QoSProfile(depth=QUEUE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        for kind, topic, hear, qos in (
            (Odometry, "odometry", self._hear_odometry, SENSOR_QOS),
            (String, "traction_controller/state", self._hear_state, states),
            (Float64MultiArray, "traction_controller/commands", self._hear_torques, torques),
            (DiagnosticArray, "/diagnostics", self._hear_diagnostics, TOPIC_QOS),
        ):
            self.create_subscription(kind, topic, hear, qos)

    def _hear_odometry(self, odometry: Odometry) -> None:
        self.pose = odometry_to_pose(odometry, "map")[0][[0, 1, 5]]

    def _hear_state(self, state: String, about: dict[str, int]) -> None:
        self._sent.append((sent_at(about), state.data, False))

    def _hear_torques(self, message: Float64MultiArray, about: dict[str, int]) -> None:
        self._sent.append((sent_at(about), "", any(message.data)))

    def _hear_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name.startswith("traction_controller"):
                fault = without_numbers(status.message) if status.level == b"\2" else ""
                self.faults[fault] += bool(fault) and fault != self._fault
                self._fault = fault

    def find_torques_at_rest(self) -> list[str]:
        """Return the state of each torque sent at rest until now, and for how long it had been so.

        The first torques of a drive, which are sent before its state, are zero.
        """
        found, since, rest = [], np.inf, ""
        for at, state, turns in sorted(self._sent):  # messages come in another order
            if state:
                since, rest = np.inf if state == "driving" else at, state
            elif turns and at - since > FLIGHT:
                found.append(f"{rest} for {at - since:.2f} s")
        return found


def sent_at(about: dict[str, int]) -> float:
    """Return when a message was sent, on the clock of the machine [s].

    What was sent after it was received is stamped by the clock that is ahead.
    """
    sent, received = about["source_timestamp"], about["received_timestamp"]
    return sent / 1e9 - (max(STEPS) if sent > received else 0)


def without_numbers(text: str) -> str:
    """Return a text with # for each number."""
    return re.sub(r"[-\d.]+", "#", text)


class Programs:
    """The programs by name; each can be killed and started again."""

    def __init__(self, nodes: NodeProcesses, terrain: Path):
        self._nodes, self.clock = nodes, SteppedClock(nodes.folder)
        self.running: dict[str, ChildProcess] = {}
        files = {
            "rover_simulator": self._write(
                "rover_simulator", terrain_file=str(terrain), speed=0.08
            ),
            "traverse_server": self._write(
                "traverse_server", map_folder=str(nodes.folder), monitor=True
            ),
            "traction_controller": self._write(
                "simulated_traction_controller", rest_policy="brake", stop_timeout=STOP_TIMEOUT
            ),  # at rest there are no torques
        }
        self._modules = {
            name: [f"rover_planner.nodes.{name}", "--ros-args", "--params-file", file]
            for name, file in files.items()
        }
        page = [PAGE, "lsr1", str(terrain), "--follow", "--port", "0"]
        self._modules[PAGE] = ["rover_planner", *page]
        for name in self._modules:
            self.start(name)

    def _write(self, stem: str, **values: Any) -> str:
        """Write a parameter file of the package with other values; return its name."""
        content = yaml.safe_load((PARAMETERS / f"{stem}.yaml").read_text())
        content["/**"]["ros__parameters"] |= {"realtime_priority": PRIORITY} | values
        file = self._nodes.folder / f"{stem}.yaml"
        file.write_text(yaml.dump(content))
        return str(file)

    def start(self, name: str, module: list[str] | None = None) -> None:
        """Start a program, with its module and words or others."""
        words, environment = module or self._modules[name], {**self.clock.environment, **LOOPBACK}
        self.running[name] = self._nodes.start_module(*words, environment=environment)

    def kill(self, name: str) -> None:
        """Kill a program."""
        if self.running[name].poll() is None:
            os.kill(self.running[name].pid, signal.SIGKILL)


def run_soak(minutes: float, calm: float, every: float, load: int, seed: int) -> dict[str, object]:
    """Run a soak of some minutes, and calm ones after that; return its report."""
    with open_nodes() as nodes:
        for _ in range(load):
            nodes.start_module("timeit", "-n", str(10**12), "pass")
        soak = Soak(nodes, seed)
        return {
            "at the start": soak.measure(),
            "disturbed": soak.run(minutes, every),
            "calm": soak.run(calm, np.inf),
            "torques at rest": soak.ear.find_torques_at_rest(),
        }


class Soak:
    """Drives and disturbances, and what becomes of them."""

    def __init__(self, nodes: NodeProcesses, seed: int):
        self._rng, maps = np.random.default_rng(seed), []
        for cover in ROCKS:
            ground = make_mars_terrain(seed, 24.0, 0.05, rock_cover=cover, crater_density=0.0)
            maps.append(nodes.folder / f"{cover}.npz")
            save_terrain(maps[-1], ground)
        self._programs, self.ear = Programs(nodes, maps[0]), nodes.ros.spin(Ear(nodes.ros))
        self._client = nodes.client("soak")
        wait_until(lambda: np.isfinite(self.ear.pose).all(), "the simulator", START_TIME)
        self._client.connect()
        self._maps, self._victims = itertools.cycle(maps), itertools.cycle(VICTIMS)
        self._steps = itertools.cycle(STEPS)
        self._load = self._client.node.create_client(LoadMap, "/traverse_server/load_map")
        self._drives, self._events = Counter[str](), Counter[str]()
        self._disturbances = itertools.cycle((self._kill, self._change_map, self._step_clock))
        self._start_mission()

    def run(self, minutes: float, every: float) -> dict[str, object]:
        """Drive for some time, with a disturbance each so many seconds; return the report."""
        for counter in (self.ear.faults, self._drives, self._events):
            counter.clear()
        loads = [os.getloadavg()[0]]
        begin = time.monotonic()
        end, due = begin + 60.0 * minutes, begin + every
        while time.monotonic() < end:
            time.sleep(0.5)
            loads.append(os.getloadavg()[0])
            mission = self._programs.running[MISSION]
            if mission.poll() is not None:
                how = _ENDS.get(mission.returncode) or without_numbers(mission.last_line())
                self._drives[how] += 1
                self._start_mission()
            if time.monotonic() > due:
                due += every
                next(self._disturbances)()
        return {
            "minutes": minutes,
            "median and largest load of the machine": np.quantile(loads, (0.5, 1.0)).tolist(),
            "drives": dict(self._drives),
            "disturbances": dict(self._events),
            "faults": {cause: count for cause, count in self.ear.faults.items() if count},
            **self.measure(),
        }

    def measure(self) -> dict[str, object]:
        """Return memory and latency now."""
        running = self._programs.running
        memory = {
            name: memory_of(child) for name, child in running.items() if child.poll() is None
        }
        return {"memory [MB]": memory, "answer [ms]": self._find_latency()}

    def _kill(self) -> None:
        victim = next(self._victims)
        self._events[f"kills of {victim}"] += 1
        self._programs.kill(victim)
        time.sleep(1.0)
        if victim != MISSION:
            self._programs.start(victim)

    def _change_map(self) -> None:
        """Load another map, and assume another friction: all that is watched is judged again."""
        request = LoadMap.Request(map_url=next(self._maps).name)
        with contextlib.suppress(TimeoutError):
            response = finish(self._load.call_async(request), PATIENCE)
            assert response.result == LoadMap.Response.RESULT_SUCCESS, response.result
            self._client.set_parameter("friction", float(self._rng.uniform(0.6, 0.8)))
            self._events["changes of map and friction"] += 1

    def _step_clock(self) -> None:
        self._programs.clock.set_ahead(next(self._steps))
        self._events["steps of the clock"] += 1

    def _start_mission(self) -> None:
        """Send the rover to a goal near it, towards the middle of the ground."""
        (x, y, yaw), rng = self.ear.pose, self._rng
        is_far = np.hypot(x, y) > 2.0 * REACH
        bearing = np.arctan2(-y, -x) if is_far else rng.uniform(-np.pi, np.pi)
        bearing += rng.uniform(-0.5, 0.5)
        far = rng.uniform(0.5, 1.0) * REACH
        start = f"{x:.3f},{y:.3f},{yaw:.3f}"
        goal = f"{x + far * np.cos(bearing):.3f},{y + far * np.sin(bearing):.3f},{bearing:.3f}"
        words = f"--start={start}", f"--goal={goal}", "--drive"
        self._programs.start(MISSION, ["rover_planner.nodes.mission_planner", *words])

    def _find_latency(self) -> float:
        """Return the median time of a question of 1 m [ms]."""
        taken = []
        for _ in range(10):
            begin = time.monotonic()
            x, y, yaw = self.ear.pose.tolist()
            with contextlib.suppress(TimeoutError):
                self._client.plan((x, y, yaw), (x + np.cos(yaw), y + np.sin(yaw), yaw), PATIENCE)
            taken.append(1e3 * (time.monotonic() - begin))
        return median(taken)


_ENDS = {0: "arrived", 3: "not traversable", -9: "killed"}
"""Ends of a mission by exit code; the others say why."""


def main(
    minutes: Annotated[float, typer.Option(help="Minutes with disturbances.")] = 40.0,
    calm: Annotated[float, typer.Option(help="Minutes without, after that.")] = 20.0,
    load: Annotated[int, typer.Option(help="Processes that do nothing but compute.")] = 2,
    every: Annotated[float, typer.Option(help="Time between disturbances in s.")] = 40.0,
    seed: Annotated[int, typer.Option(help="Seed of ground and goals.")] = 1,
) -> None:
    """Run a soak and print its report as JSON."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # its programs end with it
    os.environ |= LOOPBACK
    print(json.dumps(run_soak(minutes, calm, every, load, seed), indent=2))


if __name__ == "__main__":
    typer.run(main)
