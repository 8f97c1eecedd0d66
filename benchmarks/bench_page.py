# SPDX-License-Identifier: Apache-2.0
"""Times the page in a browser, from Enter in a box to the verdict, and reads the memory behind it.

Needs Chromium and the extras view and test.
"""

import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from benchmarks.grounds import made_reef
from benchmarks.measure import Figure
from benchmarks.processes import memory_of
from rover_physics.terrain.grid import save_terrain
from support.viewer.browser import Visitor, open_browser
from support.viewer.sessions import wait_patiently as wait_until

TRIES = 15
"""Values that are typed, of which the median counts."""
MOST = 213.0
"""Largest time to the verdict before the front end was built anew [ms]."""
MOST_MEMORY = 600.0
"""Largest resident memory of the program [MB]."""
AT_REST = "!document.querySelector('#judging, #old, #paths [data-old]:not([data-old=false])')"
ENTER = """(value) => new Promise((done) => {
  const begun = performance.now(), subject = document.getElementById("subject");
  const box = document.querySelector('input[type=number][aria-label="friction [-]"]');
  new MutationObserver((_changes, observer) => {
    if (!subject.innerText.includes(`friction ${value}`)) return;
    observer.disconnect();
    requestAnimationFrame(() => done(performance.now() - begun));
  }).observe(subject, { childList: true });
  box.value = value;
  box.dispatchEvent(new Event("change"));
})"""
"""Types a friction; the time until the page shows what was judged for it [ms]."""


def measure() -> list[Figure]:
    """Measure on the made ground that the page shows without one, and on the made reef."""
    with tempfile.TemporaryDirectory() as folder:
        save_terrain(file := Path(folder) / "reef.npz", made_reef())
        return [*measure_on("made ground"), *measure_on("made reef", str(file))]


def measure_on(name: str, *terrain: str) -> Iterator[Figure]:
    """Yield the figures on a ground."""
    with open_view("lsr1", *terrain) as (program, url), open_browser() as browser:
        visitor, times = Visitor(browser, url), []
        for k in range(TRIES):
            visitor.tab.wait_for_timeout(300)  # until what follows the last verdict has begun
            wait_until(lambda: visitor.tab.evaluate(AT_REST), "all paths to be judged")
            times.append(visitor.tab.evaluate(ENTER, f"{0.6 + 0.01 * k:.2f}".rstrip("0")))
        memory = memory_of(program, "VmRSS")
    enter, most = f"{name}, Enter to the verdict", f"{name}, memory of the program"
    yield Figure("page", enter, statistics.median(times), "ms", MOST, repeats=TRIES)
    yield Figure("page", most, memory, "MB", MOST_MEMORY, repeats=1)


@contextmanager
def open_view(*arguments: str, port: int = 0) -> Iterator[tuple[subprocess.Popen, str]]:
    """Run `rover_planner view` and yield its process and address."""
    command = [sys.executable, "-m", "rover_planner", "view", *arguments, "--port", str(port)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            line = next(line for line in process.stdout or () if line.startswith("open "))
            yield process, line.split()[1]
        finally:
            process.kill()
