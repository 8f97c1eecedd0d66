"""Surveys a made Mars with the command, and measures its processes: CPU time and memory.

    python -m benchmarks.large_survey FOLDER [--side METRES] [--workers N] [--from X,Y]

FOLDER gets map and store, some 0.5 GB for 160 m. The same command goes on after an interruption;
then CPU time and rate are those of the last part.
"""

import argparse
import json
import subprocess
import sys
import time
from pathlib import Path

import psutil

PERIOD = 1.0
"""Time between two looks at the processes [s]."""
HEADINGS = 8


class Watch:
    """CPU time and largest memory of a command and its workers, by process."""

    def __init__(self, command: list[str]):
        """Start a command."""
        self._process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        self._seconds: dict[int, float] = {}
        self._memory: dict[int, int] = {}
        self._workers: set[int] = set()

    def wait(self) -> str:
        """Look until the command ends; return what it printed."""
        root = psutil.Process(self._process.pid)
        while self._process.poll() is None:
            self._look(root)
            time.sleep(PERIOD)
        assert self._process.stdout is not None
        printed = self._process.stdout.read()
        if self._process.returncode:
            raise SystemExit(self._process.returncode)
        return printed

    def tell(self) -> dict[str, float]:
        """Return CPU times [s] and largest memories [bytes]."""
        root, workers = self._process.pid, self._workers
        return {
            "command_seconds": self._seconds.get(root, 0.0),
            "command_memory": self._memory.get(root, 0),
            "worker_seconds": sum(self._seconds[one] for one in workers),
            "worker_memory": max((self._memory[one] for one in workers), default=0),
        }

    def _look(self, root: psutil.Process) -> None:
        try:
            family = [root, *root.children(recursive=True)]
        except psutil.NoSuchProcess:
            return
        for process in family:
            try:
                times, words = process.cpu_times(), " ".join(process.cmdline())
                self._memory[process.pid] = read_peak(process.pid)
                self._seconds[process.pid] = times.user + times.system
            except (psutil.Error, OSError):
                continue
            if "spawn_main" in words:
                self._workers.add(process.pid)


def read_peak(number: int) -> int:
    """Return the largest memory that a process has had [bytes]."""
    lines = Path(f"/proc/{number}/status").read_text().splitlines()
    line = next((line for line in lines if line.startswith("VmHWM:")), "VmHWM: 0 kB")
    return 1024 * int(line.split()[1])


def main(words: list[str]) -> None:
    """Make the map, survey it, search what can be reached; print what each took."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("folder", type=Path)
    asked.add_argument("--side", default="160")
    asked.add_argument("--workers", default="2")
    asked.add_argument("--from", dest="start", default="0,0")
    options = asked.parse_args(words)
    options.folder.mkdir(parents=True, exist_ok=True)
    ground, store = options.folder / "mars.npz", options.folder / "mars.zarr"
    program = [sys.executable, "-m", "rover_planner"]
    if not ground.exists():
        made = ["terrain", str(ground), "--size", options.side, "--seed", "7"]
        subprocess.run([*program, *made], check=True)
    asked_of = ["survey", "lsr1", str(ground), str(store), "--headings", str(HEADINGS)]
    watch = Watch([*program, *asked_of, "--workers", options.workers, "--memory-limit", "1GiB"])
    report = json.loads(watch.wait())
    measured = watch.tell()
    cells = report["poses"] / HEADINGS
    show("survey", {**report, **measured})
    if measured["worker_seconds"]:
        print(f"cells a second and core: {cells / measured['worker_seconds']:.0f}")
    watch = Watch([*program, "reachable", str(store), f"--from={options.start}"])
    show("reachable", {**json.loads(watch.wait()), **watch.tell()})


def show(name: str, numbers: dict[str, object]) -> None:
    """Print numbers as a line of JSON."""
    print(name, json.dumps(numbers), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
