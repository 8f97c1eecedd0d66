"""Measures how fast the traction controller fails safe, and that it drives through what is normal.

Run from the repository: python -m benchmarks.reliability_controller [--repeats N] [--seconds S]
    [--priority P]
The controller runs in a process of its own. Both processes run under libfaketime (Debian's package
faketime), which steps their system clock; without it those steps are left out. Times are from the
cause to the arrival of the first command that does not push. On a busy machine they need a
real-time priority. The results are in docs/reliability.md.
"""

import argparse
import contextlib
import json
import os
import resource
import select
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from std_srvs.srv import SetBool

from benchmarks.measure import Figure, show, write
from rover_planner.demo.child_process import ChildProcess, stopping_children
from rover_planner.nodes.traction_controller import TractionController
from rover_planner.ros.qos import sensor_qos
from rover_planner.ros.realtime import take_priority
from support.driven_rover import CONTROLLER, NANOSECONDS, DrivenRover
from support.ros_fixtures import RosRun, call, domain_id
from support.waiting import wait_until

TOPIC = "controller"
LIMIT = 100.0
"""Longest allowed time from a cause to zero or hold [ms]."""
SHOWN_LIMIT = 2000.0
"""Longest allowed time from a cause to an error in diagnostics [ms]."""
HOUR = 3600
"""Step of the system clock [s]."""
CLOCK_FILE = "FAKETIME_TIMESTAMP_FILE"
"""Environment variable of libfaketime that names the file with the offset of the clock."""
LIBRARIES = sorted(Path("/usr/lib").glob("*/faketime/libfaketimeMT.so.1"))
NICENESS = -15
"""Niceness of both processes, where it is granted: other programs run beside them."""
MAX_BUSY_TIME = 1_000_000
"""Processor time without a pause after which a process of real-time priority is ended [us]: it
would block the machine."""
LONGEST = 1800.0
"""Longest time of the process whose clock is stepped [s]."""
ROOT = Path(__file__).resolve().parents[1]
PERIOD = 0.02
"""Period of the controller [s]."""


class Bench:
    """A rover in this process and a controller in another, whose clocks are stepped together."""

    def __init__(self, run: RosRun, folder: Path, children: list[ChildProcess]):
        self._run, self._folder, self._children = run, folder, children
        self._offset = 0
        self.rover = DrivenRover(run.context)
        self.rover.send_twists()
        self.rover.stamp = time.time_ns
        run.spin(self.rover)
        self._stop = self.rover.create_publisher(Bool, f"{CONTROLLER}/emergency_stop", 1)
        self._clock = self.rover.create_publisher(Clock, "/clock", 10)
        self.clock_runs = False
        self.rover.create_timer(0.01, self._tick)

    def step_clock(self, seconds: int) -> None:
        """Step the system clock of both processes."""
        self._offset += seconds
        new = self._folder / "new"
        new.write_text(f"{self._offset:+d}\n")
        new.replace(os.environ[CLOCK_FILE])

    def start_controller(self, **parameters: object) -> None:
        """Start an enabled controller and wait until it drives."""
        values = {"enabled_at_start": "true"} | parameters
        words = [w for name, value in values.items() for w in ("-p", f"{name}:={value}")]
        environment = os.environ | {
            "ROS_DOMAIN_ID": str(domain_id()),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "PYTHONPATH": str(ROOT),
        }
        log = self._folder / f"{len(self._children)}.log"
        module = "rover_planner.nodes.traction_controller"
        child = ChildProcess(module, ["--ros-args", *words], environment, log)
        self._children.append(child)
        self.wait_until_driving(120.0)

    def stop_controller(self) -> None:
        """End the controller."""
        self._children.pop().stop()
        self.rover.states.clear()
        self.rover.commands.clear()

    def wait_until_driving(self, timeout: float = 20.0) -> None:
        """Wait until the rover is driven, and a little longer."""
        wait_until(
            lambda: self.rover.state == "driving" and self.rover.push > 0.0, "driving", timeout
        )
        time.sleep(0.5)

    def measure_rest(self, cause: Callable[[], None]) -> float:
        """Return the time from a cause to the first command without push [ms]."""
        rover = self.rover
        wait_until(lambda: len(rover.commands) > 10, "commands")
        heard, began = len(rover.commands), time.monotonic()
        cause()
        found = wait_until(
            lambda: [at for at, _, push in rover.commands[heard:] if push <= 0.0], "rest"
        )
        return 1e3 * (found[0] - began)

    def measure_shown(self, text: str, since: float) -> float:
        """Return the time until an error with a text is in diagnostics [ms]."""

        def find() -> list[float]:
            told = list(self.rover.diagnostics)
            return [at for at, s in told if at > since and text in s.message and s.level != b"\0"]

        return 1e3 * (wait_until(find, text)[0] - since)

    def press(self) -> None:
        """Press the emergency stop."""
        self._stop.publish(Bool(data=True))

    def release(self) -> None:
        """Release the emergency stop and enable the controller."""
        wait_until(lambda: self.rover.state == "emergency_stop", "the stop")
        self._stop.publish(Bool(data=False))
        wait_until(lambda: self.rover.state == "disabled", "the release")
        call(self._client(SetBool, "enable"), SetBool.Request(data=True))

    def set_parameter(self, name: str, value: object) -> None:
        """Set a parameter of the controller."""
        request = SetParameters.Request(
            parameters=[Parameter(name, value=value).to_parameter_msg()]
        )
        answer = call(self._client(SetParameters, "set_parameters"), request)
        assert answer.results[0].successful, answer.results[0].reason

    def _client(self, kind: type, name: str):
        if not hasattr(self, f"_{name}"):
            setattr(self, f"_{name}", self.rover.create_client(kind, f"{CONTROLLER}/{name}"))
        return getattr(self, f"_{name}")

    def _tick(self) -> None:
        if self.clock_runs:
            now = time.time_ns()
            message = Clock()
            message.clock.sec, message.clock.nanosec = divmod(now, NANOSECONDS)
            self._clock.publish(message)


@contextlib.contextmanager
def make_bench() -> Iterator[Bench]:
    """Yield a bench; everything that it started has ended after the block."""
    run = RosRun()
    with tempfile.TemporaryDirectory() as folder, stopping_children() as children:
        try:
            yield Bench(run, Path(folder), children)
        finally:
            run.close()


def measure_case(
    bench: Bench, name: str, text: str, cause: Callable[[], None], mend: Callable[[], None],
    repeats: int,
) -> list[Figure]:  # fmt: skip
    """Cause a fault and mend it several times; return the longest times to rest and to notice."""
    rests, shown = [], []
    for _ in range(repeats):
        bench.wait_until_driving()
        began = time.monotonic()
        rests.append(bench.measure_rest(cause))
        shown.append(bench.measure_shown(text, began))
        mend()
    return [
        Figure(TOPIC, f"{name}: zero or hold within", max(rests), "ms", LIMIT, repeats=repeats),
        Figure(TOPIC, f"{name}: in diagnostics within", max(shown), "ms", SHOWN_LIMIT,
               repeats=repeats),
    ]  # fmt: skip


def measure_faults(bench: Bench, repeats: int) -> list[Figure]:
    """Measure faults of stamps, clocks and sensors, and the emergency stop."""
    rover, figures = bench.rover, []

    def shift_stamps(shift: float | None) -> None:
        frozen = time.time_ns()
        rover.stamp = lambda: (
            frozen if shift is None else time.time_ns() + round(shift * NANOSECONDS)
        )

    def mend() -> None:
        rover.stamp = time.time_ns
        rover.silent.clear()

    bench.start_controller()
    if CLOCK_FILE in os.environ:
        for name, step, text in (
            ("system clock stepped back by an hour", -HOUR, "stepped back"),
            ("system clock stepped ahead by an hour", HOUR, "stepped ahead"),
        ):
            figures += measure_case(
                bench, name, text, lambda step=step: bench.step_clock(step), mend, repeats
            )
    for name, shift, text in (
        ("stamps frozen", None, "do not advance"),
        ("stamps delayed by 1 s", -1.0, "stale"),
        ("stamps 1 s in the future", 1.0, "ahead"),
    ):
        figures += measure_case(
            bench, name, text, lambda shift=shift: shift_stamps(shift), mend, repeats
        )
    for silent in ("joint_states", "imu"):
        figures += measure_case(
            bench, f"{silent} silent", f"{silent} stale",
            lambda silent=silent: rover.silent.add(silent), mend, repeats,
        )  # fmt: skip
    figures += measure_case(
        bench, "emergency stop", "emergency_stop", bench.press, bench.release, repeats
    )
    bench.stop_controller()
    return figures


def measure_stopped_clock(bench: Bench, repeats: int) -> list[Figure]:
    """Measure a /clock that stops, with stamps that stop with it, and without stamps."""
    figures = []
    bench.clock_runs = True
    bench.start_controller(use_sim_time="true")
    for name, stamp in (("stamps stop too", None), ("no stamps", 0)):

        def stop(stamp=stamp) -> None:
            bench.clock_runs = False
            value = time.time_ns() if stamp is None else stamp
            bench.rover.stamp = lambda: value

        def start() -> None:
            bench.clock_runs = True
            bench.rover.stamp = time.time_ns

        figures += measure_case(
            bench, f"/clock stopped, {name}", "/clock stands still", stop, start, repeats
        )
    bench.stop_controller()
    return figures


def measure_hang(bench: Bench, repeats: int) -> list[Figure]:
    """Measure the watchdog while the executor of a controller in this process hangs for 0.5 s."""
    run = RosRun()
    enabled = [Parameter("enabled_at_start", value=True)]
    node = TractionController(context=run.context, parameter_overrides=enabled)
    hang = node.create_guard_condition(lambda: time.sleep(0.5))
    run.spin(node)

    def cause() -> None:
        hang.trigger()
        node.executor.wake()

    try:
        return measure_case(
            bench,
            "executor hangs for 0.5 s",
            "updates came too late",
            cause,
            lambda: None,
            repeats,
        )
    finally:
        run.close()
        bench.rover.states.clear()
        bench.rover.commands.clear()


def measure_normal(bench: Bench, seconds: float) -> list[Figure]:
    """Measure drop-outs with an arm's messages between the wheels' and cmd_vel at 10 Hz."""
    rover = bench.rover
    arm = JointState(name=["arm_yaw", "arm_shoulder"], position=[0.1, 0.2], velocity=[0.0, 0.0])
    sender = rover.create_publisher(JointState, "joint_states", sensor_qos())
    rover.cmd_vel_divider = 5
    bench.start_controller()
    heard, end = len(rover.commands), time.monotonic() + seconds
    while time.monotonic() < end:
        sender.publish(arm)
        time.sleep(PERIOD)
    commands = rover.commands[heard:]
    rover.cmd_vel_divider = 1
    bench.stop_controller()
    lost = sum(push <= 0.0 for *_, push in commands)
    name = "commands without push, an arm's joint_states at 50 Hz between and cmd_vel at 10 Hz"
    return [Figure(TOPIC, name, lost, "", 0.0, repeats=len(commands))]


def measure_changes(bench: Bench, repeats: int) -> list[Figure]:
    """Measure the largest change of the torques around changes of parameters."""
    rover = bench.rover
    bench.start_controller(torque_rate=2.0)
    heard = len(rover.commands)
    for _ in range(repeats):
        for name, value in (
            ("friction", 0.3), ("policy", "equal"), ("slip_gain", 5.0), ("max_torque", 1.0),
            ("friction", 0.8), ("policy", "optimal"), ("slip_gain", 1.0), ("max_torque", 2.0),
        ):  # fmt: skip
            bench.set_parameter(name, value)
            time.sleep(0.1)
    commands = np.array(rover.commands[heard:])
    bench.stop_controller()
    steps = np.abs(np.diff(commands[:, 1]))
    lost = int((commands[:, 2] <= 0.0).sum())
    count = 8 * repeats
    return [
        Figure(TOPIC, "parameter changes: largest step of a torque, 2 N m/s x 20 ms allowed",
               1e3 * float(steps.max()), "mN m", repeats=count),
        Figure(TOPIC, "parameter changes: commands without push", lost, "", 0.0, repeats=count),
    ]  # fmt: skip


def measure(repeats: int, seconds: float) -> list[Figure]:
    """Measure everything; see the module's text."""
    figures = []
    with make_bench() as bench:
        figures += measure_faults(bench, repeats)
        figures += measure_stopped_clock(bench, repeats)
        figures += measure_changes(bench, repeats)
        figures += measure_normal(bench, seconds)
    return figures


def take_priority_safely(priority: int) -> None:
    """Take a real-time priority, 0 for a low niceness; both pass on to child processes.

    Threads that are there already keep theirs.
    """
    if priority == 0:
        with contextlib.suppress(PermissionError):
            os.setpriority(os.PRIO_PROCESS, 0, NICENESS)
        return
    resource.setrlimit(resource.RLIMIT_RTTIME, (MAX_BUSY_TIME, MAX_BUSY_TIME))
    refusal = take_priority(priority)
    if refusal:
        raise SystemExit(refusal)


def measure_with_stepped_clock(repeats: int, seconds: float) -> list[Figure]:
    """Measure everything in a process whose system clock a file steps."""
    with tempfile.TemporaryDirectory() as folder:
        file, out = Path(folder) / "clock", Path(folder) / "figures.json"
        file.write_text("+0\n")
        environment = os.environ | {
            "LD_PRELOAD": str(LIBRARIES[0]),
            CLOCK_FILE: str(file),
            "FAKETIME_NO_CACHE": "1",
            "FAKETIME_DONT_FAKE_MONOTONIC": "1",
            "DONT_FAKE_MONOTONIC": "1",
        }
        words = ["--repeats", str(repeats), "--seconds", str(seconds), "--out", str(out)]
        with stopping_children() as children:
            log = Path(folder) / "log"
            child = ChildProcess("benchmarks.reliability_controller", words, environment, log)
            children.append(child)
            end = time.monotonic() + LONGEST
            while child.running and time.monotonic() < end:
                time.sleep(0.2)
            assert child.exit_code == 0, log.read_text(errors="replace")
        rows = json.loads(out.read_text())
    return [Figure(**{k: v for k, v in row.items() if k != "met"}) for row in rows]


def main() -> None:
    """Measure, print a table and write the figures."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--repeats", type=int, default=10, help="repeats of each fault")
    parser.add_argument("--seconds", type=float, default=60.0, help="time of normal driving")
    parser.add_argument("--priority", type=int, default=0, help="real-time priority, 0 for none")
    parser.add_argument("--out", type=Path, help="file for the figures as JSON")
    arguments = parser.parse_args()
    repeats, seconds = arguments.repeats, arguments.seconds
    take_priority_safely(arguments.priority)
    if CLOCK_FILE in os.environ:  # libfaketime breaks the system call of time.sleep
        time.sleep = lambda seconds: select.select((), (), (), seconds)  # type: ignore[assignment]
        write(measure(repeats, seconds), arguments.out)
        return
    stepped = measure_with_stepped_clock if LIBRARIES else measure
    with make_bench() as bench:
        figures = measure_hang(bench, repeats)
    figures += stepped(repeats, seconds)
    show(figures)
    if arguments.out:
        write(figures, arguments.out)


if __name__ == "__main__":
    main()
