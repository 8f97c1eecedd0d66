"""Runs all benchmarks, prints one table and writes it as JSON: `make bench`.

Run from the repository: python -m benchmarks.run [topic ...]; the topics are the files bench_*.py.
Each runs in a separate process, so that memory and threads of one do not affect another.
"""

import importlib
import json
import subprocess
import sys
import tempfile
from pathlib import Path

from rich.console import Console

from benchmarks.measure import Figure, show, write

HERE = Path(__file__).resolve().parent
RESULTS = HERE.parent / "bench_output" / "results.json"


def run_topic(name: str) -> list[Figure]:
    """Run one benchmark in a separate process."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "figures.json"
        command = [sys.executable, "-m", "benchmarks.run", "--only", name, str(out)]
        subprocess.run(command, check=True, cwd=HERE.parent)
        rows = json.loads(out.read_text())
    return [Figure(**{k: v for k, v in row.items() if k != "met"}) for row in rows]


def main(arguments: list[str]) -> int:
    """Run the named topics, default all."""
    if arguments[:1] == ["--only"]:
        write(importlib.import_module(f"benchmarks.{arguments[1]}").measure(), Path(arguments[2]))
        return 0
    names = [f"bench_{name.removeprefix('bench_')}" for name in arguments]
    names = names or sorted(path.stem for path in HERE.glob("bench_*.py"))
    figures, console = [], Console(stderr=True)
    for name in names:
        console.print(f"measuring: {name.removeprefix('bench_')}")
        figures += run_topic(name)
    show(figures)
    write(figures, RESULTS)
    console.print(f"written to {RESULTS.relative_to(Path.cwd())}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
