"""Counts what became of the inputs: taken, refused, or a defect with its text."""

import resource
from collections import Counter, defaultdict
from dataclasses import dataclass, field
from pathlib import Path

from rich.console import Console
from rich.table import Table

TAKEN, REFUSED = "taken", "refused"
"""Outcomes of inputs in this process."""
WHOLE, DAMAGED = "whole", "damaged"
"""Kinds of messages over DDS, whose outcome is known to the nodes only."""
MAX_DEFECTS = 50
"""Largest number of defects that are listed."""


@dataclass
class Tally:
    """What became of the inputs of one run."""

    counts: dict[str, Counter] = field(default_factory=lambda: defaultdict(Counter))
    """Number of inputs of each outcome, by kind."""
    slowest: dict[str, float] = field(default_factory=dict)
    """Longest time for one input [s], by kind."""
    defects: list[str] = field(default_factory=list)
    """What must not happen: other exceptions, deaths, hangs, lost maps, memory."""
    notes: list[str] = field(default_factory=list)
    """Other figures of the run."""

    def take(self, kind: str, outcome: str, seconds: float) -> None:
        """Count one input."""
        self.counts[kind][outcome] += 1
        self.slowest[kind] = max(self.slowest.get(kind, 0.0), seconds)

    @property
    def total(self) -> int:
        """Number of inputs."""
        return sum(sum(counter.values()) for counter in self.counts.values())

    def show(self, title: str) -> None:
        """Print the counts, then the defects."""
        table = Table(title=f"{title}: {self.total:,} inputs")
        outcomes = sorted({name for counter in self.counts.values() for name in counter})
        for name in ("kind", "inputs", *outcomes, "slowest [ms]"):
            table.add_column(name, justify="left" if name == "kind" else "right")
        for kind in sorted(self.counts):
            counter = self.counts[kind]
            table.add_row(
                kind,
                f"{sum(counter.values()):,}",
                *(f"{counter[outcome]:,}" for outcome in outcomes),
                f"{1e3 * self.slowest[kind]:.1f}",
            )
        console = Console()
        console.print(table)
        for note in self.notes:
            console.print(note)
        console.print(f"defects: {len(self.defects)}")
        for text, count in Counter(self.defects).most_common(MAX_DEFECTS):
            console.print(f"  {count} x {text}", markup=False)


def memory_of(pid: int | str = "self") -> float:
    """Return the memory of a process in use [MB]."""
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 1e6
