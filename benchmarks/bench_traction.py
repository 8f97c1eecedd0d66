"""The traction controller at 100 Hz for a minute, while a traverse server answers beside it.

Simulator, controller and server run in processes of their own; the controller's own diagnostics
say how long its updates took (estimate, build, solve, publish) and how many cycles it missed.
"""

import threading
import time

from diagnostic_msgs.msg import DiagnosticArray
from measure import Figure
from planner_process import SERVER, Planner, planner_and_processes
from rclpy.node import Node

from rover_planner.mars_terrain import make_mars_terrain
from rover_planner.qos import topic_qos

RATE = 100.0
DURATION = 60.0
PRIORITY = 50
"""Of the controller (SCHED_FIFO), as ros2_control has it; where it is not granted, none."""
START, GOAL = (-5.0, -6.0, 0.0), (5.0, -6.0, 0.0)


class DiagnosticsReader:
    """Keeps the latest words of the controller's diagnostics."""

    def __init__(self, node: Node):
        self.words: dict[str, str] = {}
        node.create_subscription(DiagnosticArray, "/diagnostics", self._take, topic_qos())

    def _take(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name.startswith("traction_controller"):
                self.words = {value.key: value.value for value in status.values}

    def wait_for_updates(self, count: int, timeout: float = 120.0) -> dict[str, float]:
        """Return the numbers among the words once so many updates were made."""
        end = time.monotonic() + timeout
        while float(self.words.get("updates", 0)) < count:
            if time.monotonic() > end:
                raise TimeoutError(f"the controller made {self.words.get('updates', 0)} updates")
            time.sleep(0.1)
        numbers = {}
        for key, value in self.words.items():
            try:
                numbers[key] = float(value)
            except ValueError:
                continue
        return numbers


def measure() -> list[Figure]:
    """Let everything run together for a minute."""
    ground = make_mars_terrain(1, 24.0, 0.05)
    with planner_and_processes() as (planner, processes):
        reader = DiagnosticsReader(planner.node)
        processes.start_server(ground, candidate_count=1)
        planner.ask(SERVER, START, GOAL)
        processes.start_rover(ground, RATE, START, PRIORITY)
        before = reader.wait_for_updates(int(RATE))
        stop = threading.Event()
        asked = threading.Thread(target=_ask_on, args=(planner, stop))
        asked.start()
        time.sleep(DURATION)
        stop.set()
        asked.join()
        after = reader.wait_for_updates(int(before["updates"] + 0.9 * RATE * DURATION))
    missed = after["missed_cycles"] - before["missed_cycles"]
    updates = int(after["updates"] - before["updates"])
    return [
        Figure("traction", "update: estimate, build, solve, publish: median",
               after["update_time_median_ms"], "ms", 0.5, repeats=updates),
        Figure("traction", "update: 99 of 100 within", after["update_time_p99_ms"], "ms", 2.0,
               repeats=updates),
        Figure("traction", "cycles missed at 100 Hz in a minute, a server busy beside it", missed,
               "", 0.0, repeats=updates),
        Figure("traction", "updates that fell back to equal torques", after["fallbacks"], "",
               repeats=updates),
    ]  # fmt: skip


def _ask_on(planner: Planner, stop: threading.Event) -> None:
    """Ask one question after another until told to stop."""
    while not stop.is_set():
        planner.ask(SERVER, START, GOAL)
