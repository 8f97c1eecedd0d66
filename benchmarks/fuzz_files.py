"""Throws hostile files and command lines at the program: python -m benchmarks.fuzz_files."""

import argparse
import contextlib
import io
import resource
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.hostile_files import FileMaker, make_oddities
from rover_physics.errors import RoverError
from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.grid import Terrain, load_terrain, save_terrain
from rover_physics.terrain.soil_file import load_soils
from rover_planner.cli import main as run_command
from rover_planner.command.prediction_files import read_poses, read_prediction
from rover_planner.errors import PlanningError
from rover_planner.shell.exit_codes import EXIT_BAD_INPUT, EXIT_OK
from rover_planner.shell.one_line import MAX_LINE
from rover_planner.studies.study_file import load_study
from rover_planner.worlds.map_file import MapLimits, open_map

TOO_LONG = 5.0
"""Time for one input above which it counts as a hang [s]."""
MAX_GROWTH = 400.0
"""Largest growth of the memory ever in use [MB]."""
MAX_SHOWN = 50
"""Largest number of defects that are printed."""
WORDS = (
    "nan", "inf", "-inf", "0", "-1", "1e308", "-1e308", "1e-308", "9" * 400, "9" * 5000, "",
    " ", "x", "é", "\n", "\udcff", "1e12", "1_0", "0x10", "--", "-", "1,2", "=",
)  # fmt: skip
"""Values of options."""
GOOD_WORDS = ("0.5", "1", "2", "3")
OPTIONS = {
    "predict": ("--friction", "--max-torque", "--policy", "--soil", "--arm", "--payload",
                "--tool-force", "--sigmas", "--max-cells", "--classes", "--nonsense"),
    "reach": ("--friction", "--max-torque", "--policy", "--soil", "--payload", "--force"),
    "terrain": ("--size", "--resolution", "--seed", "--roughness", "--rocks", "--craters"),
    "view": ("--port", "--host", "--start", "--max-gap", "--prediction"),
}  # fmt: skip
"""Options by command."""
TRIPLES = ("--tool-force", "--force", "--start")
"""Options with three values."""


class FileFuzzer:
    """Throws one hostile input after the other and keeps what must not happen."""

    def __init__(self, seed: int, folder: Path):
        self.maker = FileMaker(seed)
        self.folder = folder
        self.counts: Counter[tuple[str, str]] = Counter()
        """Number of inputs by kind and outcome."""
        self.slowest: dict[str, float] = {}
        """Longest time for one input [s], by kind."""
        self.defects: list[str] = []
        """Other exceptions, warnings, hangs, long texts and wrong exit codes."""
        self._odd = make_oddities(folder)
        names = ("out.npz", "out.npz", "out.npz", "pipe", "folder", "loop", "x" * 300, "no/out")
        self._outputs = [*(str(folder / name) for name in names), "/dev/full", ""]
        self._terrain, self._poses, self._prediction = self._write_good_files()
        self._kinds: dict[str, Callable[[], str]] = {
            "terrain file": lambda: self._read(load_terrain, self._terrain),
            "poses file": lambda: self._read(read_poses, self._poses),
            "prediction file": lambda: self._read(read_prediction, self._prediction),
            "map URL": self._ask_for_map,
            "YAML file": self._read_yaml,
            "command line": self._run,
        }

    def run(self, count: int) -> None:
        """Throw a number of inputs."""
        before = memory_peak()
        for _ in range(count):
            kind = self.maker.pick(list(self._kinds))
            began = time.perf_counter()
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("error")
                    outcome = self._kinds[kind]()
            except Exception as error:
                outcome = "defect"
                self.defects.append(f"{kind}: {type(error).__name__}: {error!s:.300}")
            took = time.perf_counter() - began
            self.counts[kind, outcome] += 1
            self.slowest[kind] = max(self.slowest.get(kind, 0.0), took)
            if took > TOO_LONG:
                self.defects.append(f"{kind}: took {took:.1f} s")
        growth = memory_peak() - before
        if growth > MAX_GROWTH:
            self.defects.append(f"memory grew by {growth:.0f} MB")

    def _write_good_files(self) -> list[dict[str, Any]]:
        """Write a terrain, poses and a prediction; return their arrays."""
        ground = Terrain(np.zeros((60, 80)), 0.05, friction=np.full((60, 80), 0.7))
        save_terrain(self.folder / "terrain.npz", ground, source="flat")
        x = np.linspace(1.0, 2.0, 8)
        np.savez(self.folder / "poses.npz", poses=np.column_stack([x, 0 * x + 1.5, 0 * x]))
        names = [str(self.folder / f"{name}.npz") for name in ("terrain", "poses", "out")]
        self._check_run(["predict", "lsr1", *names])
        found = []
        for name in names:
            with np.load(name) as archive:
                found.append(dict(archive))
        return found

    def _write(self, content: bytes) -> str:
        path = self.folder / "hostile"
        path.write_bytes(content)
        return str(path)

    def _name_or(self, content: bytes) -> str:
        """Return the name of a file with this content, or in one of eight cases an odd name."""
        return (
            self.maker.pick(self._odd) if self.maker.rng.random() < 0.12 else self._write(content)
        )

    def _read(self, read: Callable[[Path], Any], arrays: dict[str, Any]) -> str:
        name = self._name_or(self.maker.make_archive(arrays))
        return _outcome(lambda: read(Path(name)))

    def _read_yaml(self) -> str:
        name = self._name_or(self.maker.make_yaml())
        read: Callable[[Path], Any] = self.maker.pick([load_rover, load_soils, load_study])
        return _outcome(lambda: read(Path(name)))

    def _ask_for_map(self) -> str:
        name = self._name_or(self.maker.make_archive(self._terrain))
        start = self.maker.pick(["", "file://", "file:", "http://", "//[", "file://localhost"])
        folder = str(self.maker.pick([self.folder, "/", "/nowhere"]))
        limits = MapLimits(folder, 1_000_000, self.maker.pick([100, 1_000_000]))
        return _outcome(lambda: open_map(start + name, limits))

    def _run(self) -> str:
        """Run a command with odd files and values."""
        pick = self.maker.pick
        if self.maker.rng.random() < 0.1:
            study = self._name_or(self.maker.make_yaml(""))
            return self._check_run(["study", study, "--output", str(self.folder / "studies")])
        command = pick(list(OPTIONS))
        words = [command]
        if command == "terrain":
            words += [str(self.folder / "made.npz"), "--size", "2"]
        else:
            archive = self._name_or(self.maker.make_archive(self._terrain))
            words += [pick(["lsr1", "lsr1", "m2020", self._name_or(self.maker.make_yaml())])]
            words += [pick([str(self.folder / "terrain.npz"), archive])]
        if command == "predict":
            words += [str(self.folder / "poses.npz"), pick(self._outputs)]
        elif command == "reach":
            words += [self._word() for _ in range(6)]
        for _ in range(int(self.maker.rng.integers(0, 3))):
            option = pick(OPTIONS[command])
            words += [option, *(self._word() for _ in range(3 if option in TRIPLES else 1))]
        if command == "view":
            words += ["--port", pick(["-1", "65536", "99999", "9" * 400])]
        return self._check_run(words)

    def _word(self) -> str:
        """Return a value of an option, in two of three cases a good one."""
        return self.maker.pick(GOOD_WORDS if self.maker.rng.random() < 0.7 else WORDS)

    def _check_run(self, words: list[str]) -> str:
        """Run a command; keep what breaks the promise of the command line."""
        out, err = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            code = run_command(words)
        told, shown = err.getvalue(), [word[:60] for word in words]
        lines = told.splitlines()
        if code not in (EXIT_OK, EXIT_BAD_INPUT) or len(lines) != (code == EXIT_BAD_INPUT):
            self.defects.append(f"{shown}: code {code}, stderr {told[:300]!r}")
        elif lines and (len(lines[0]) > MAX_LINE or not lines[0].isprintable()):
            self.defects.append(f"{shown}: line of {len(lines[0])} characters: {lines[0][:100]!r}")
        return "taken" if code == EXIT_OK else "refused"

    def show(self) -> None:
        """Print what became of the inputs."""
        for kind in self.slowest:
            taken, refused = self.counts[kind, "taken"], self.counts[kind, "refused"]
            slowest = f"slowest {self.slowest[kind]:.2f} s"
            print(f"{kind:16} {taken:6} taken {refused:6} refused, {slowest}")
        print(f"{sum(self.counts.values())} inputs, peak memory {memory_peak():.0f} MB, "
              f"{len(self.defects)} defects")  # fmt: skip
        for text, number in Counter(self.defects).most_common(MAX_SHOWN):
            print(f"  {number} x {text!a}")


def _outcome(read: Callable[[], Any]) -> str:
    """Return whether an input was taken or refused; other errors pass."""
    try:
        read()
    except (RoverError, PlanningError) as error:
        if len(str(error)) > 1000:
            raise ValueError(f"a text of {len(str(error))} characters") from error
        return "refused"
    return "taken"


def memory_peak() -> float:
    """Return the largest memory that this process has used [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def fuzz_files(seed: int, count: int) -> FileFuzzer:
    """Throw a number of hostile files and command lines; return what became of them."""
    # In the folder: nothing is written elsewhere under an odd name.
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        fuzzer = FileFuzzer(seed, Path(folder))
        fuzzer.run(count)
        return fuzzer


def main() -> int:
    """Throw the inputs, and return 1 if there was a defect."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.fuzz_files", description=__doc__)
    parser.add_argument("--seed", type=int, default=1, help="of the random inputs (default 1)")
    parser.add_argument("--count", type=int, default=5000, help="inputs (default 5000)")
    words = parser.parse_args()
    fuzzer = fuzz_files(words.seed, words.count)
    fuzzer.show()
    return 1 if fuzzer.defects else 0


if __name__ == "__main__":
    sys.exit(main())
