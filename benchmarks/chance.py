# SPDX-License-Identifier: Apache-2.0
"""Compares chances of failure with drives whose friction and torque limit were drawn.

Run from the repository: python -m benchmarks.chance [--calibrate] [--picture FILE] [--file FILE]
The drives are those of test/data/chances.jsonl, at 0.1 m/s, or of another file that
benchmarks.chance_drives has made (docs/validation.md).
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from benchmarks.measure import print_table
from support.chance_paths import (
    CHANCES,
    HELD_OUT,
    TOLD,
    DrivenPath,
    find_chance,
    read_driven_paths,
)

MODEL_STDS = (0.03, 0.06, 0.08, 0.1, 0.15, 0.2)
"""Model errors among which the calibration chooses."""
EDGES = (0.0, 0.05, 0.2, 0.5, 0.8, 0.95, 1.0)
"""Edges of the ranges of chances in the reliability table."""
ACCEPTED = 0.05
"""Chance below which a path counts as accepted."""
SURE = 0.95
"""Share of draws from which a path counts as one that passes."""


@dataclass(frozen=True)
class Compared:
    """Predictions about paths and what became of them."""

    chance: np.ndarray
    """(n,) chance of failure."""
    refused: np.ndarray
    """(n,) whether the plain verdict refuses the path."""
    drives: np.ndarray
    """(n,) number of drives."""
    failed: np.ndarray
    """(n,) share of them that failed."""

    def brier(self, told: np.ndarray) -> float:
        """Return the Brier score of told chances (n,), over drives."""
        squares = self.failed * (1.0 - told) ** 2 + (1.0 - self.failed) * told**2
        return float(np.average(squares, weights=self.drives))

    def select(self, rows: np.ndarray) -> "Compared":
        """Return the paths where `rows` (n,) is True."""
        return Compared(*(getattr(self, name)[rows] for name in vars(self)))


def compare(paths: Sequence[DrivenPath], model_std: float | None = None) -> Compared:
    """Predict paths, with a model error other than the default if one is given."""
    found = [find_chance(one.path, model_std) for one in paths]
    chance, refused = np.array(found, float).T
    passed = [np.array(list(one.passed), int) for one in paths]
    return Compared(
        chance,
        refused > 0.5,
        np.array([len(one) for one in passed]),
        np.array([1.0 - one.mean() for one in passed]),
    )


def wilson(count: float, of: float) -> tuple[float, float]:
    """Return the 95 % interval (Wilson) of a share."""
    if not of:
        return 0.0, 1.0
    z, share = 1.96, count / of
    middle = (share + z * z / (2.0 * of)) / (1.0 + z * z / of)
    half = z / (1.0 + z * z / of) * np.sqrt(share * (1.0 - share) / of + z * z / (4.0 * of * of))
    return max(middle - half, 0.0), min(middle + half, 1.0)


def reliability(found: Compared) -> list[tuple[str, ...]]:
    """Return the rows of the reliability table."""
    rows = []
    for low, high in itertools.pairwise(EDGES):
        within = (found.chance >= low) & ((found.chance < high) | (high == 1.0))
        part = found.select(within)
        if within.any():
            drives = part.drives.sum()
            failed = (part.failed * part.drives).sum()
            low_share, high_share = wilson(failed, drives)
            told = np.average(part.chance, weights=part.drives)
            rows.append(
                (
                    f"{low:g} to {high:g}", f"{within.sum()}", f"{drives}", f"{told:.3f}",
                    f"{failed / drives:.3f}", f"{low_share:.3f} to {high_share:.3f}",
                )
            )  # fmt: skip
    return rows


def summary(name: str, found: Compared) -> tuple[str, ...]:
    """Return a row about a group of paths."""
    if not len(found.chance):
        return (name, "0", *4 * ("",))
    accepted = found.select(found.chance < ACCEPTED)
    drives, failed = accepted.drives.sum(), (accepted.failed * accepted.drives).sum()
    low, high = wilson(failed, drives)
    sure = found.select(found.failed <= 1.0 - SURE)
    refused = int((sure.chance >= ACCEPTED).sum())
    chance, plain = found.brier(found.chance), found.brier(found.refused.astype(float))
    return (
        name,
        f"{len(found.chance)}",
        f"{chance:.3f}",
        f"{plain:.3f}",
        f"{failed:.0f} of {drives} ({low:.1%} to {high:.1%})",
        f"{refused} of {len(sure.chance)}",
    )


def calibrate(paths: Sequence[DrivenPath]) -> None:
    """Print the scores of model errors on the drives that calibrate."""
    rows = []
    for std in MODEL_STDS:
        found = compare(paths, std)
        told = found.chance.clip(0.005, 0.995)
        loss = -(found.failed * np.log(told) + (1.0 - found.failed) * np.log(1.0 - told))
        likelihood = np.average(loss, weights=found.drives)
        rows.append((f"{std:g}", f"{found.brier(found.chance):.4f}", f"{likelihood:.4f}"))
    headings = ("model error", "Brier score", "log loss")
    print_table(f"Calibration on {len(paths)} paths", headings, rows)


def draw_picture(file: Path, found: Compared) -> None:
    """Draw told chances and observed shares, by path and by range."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.0, 4.2), layout="constrained")
    axes = figure.subplots()
    axes.plot([0, 1], [0, 1], "k:", lw=1)
    shift = 0.012 * np.random.default_rng(0).standard_normal((2, len(found.chance)))
    axes.plot(found.chance + shift[0], found.failed + shift[1], "o", ms=4, alpha=0.35,
              label=f"a path, {found.drives.max()} drives")  # fmt: skip
    for low, high in itertools.pairwise(EDGES):
        part = found.select((found.chance >= low) & ((found.chance < high) | (high == 1.0)))
        if len(part.chance):
            drives, share = part.drives.sum(), np.average(part.failed, weights=part.drives)
            ends = wilson(share * drives, drives)
            at = np.average(part.chance, weights=part.drives)
            axes.plot([at, at], ends, "C3", lw=2)
            axes.plot(at, share, "C3s", label="range, 95 %" if low == 0.0 else None)
    axes.set_xlabel("predicted chance of failure")
    axes.set_ylabel("share of drives that failed")
    axes.legend(frameon=False)
    figure.savefig(file, dpi=110)


def main(
    calibrate_too: Annotated[
        bool, typer.Option("--calibrate", help="Score model errors on the other drives.")
    ] = False,
    picture: Annotated[Path | None, typer.Option(help="Picture to draw.")] = None,
    file: Annotated[Path, typer.Option(help="Drives.")] = CHANCES,
) -> None:
    """Print the tables."""
    driven = read_driven_paths(file)
    held = [one for one in driven if one.stream == HELD_OUT]
    if calibrate_too:
        calibrate([one for one in driven if one.stream != HELD_OUT])
    found = compare(held)
    headings = ("chance", "paths", "drives", "told", "failed", "95 %")
    print_table(f"Reliability; {TOLD}", headings, reliability(found))
    kinds = np.array([one.path.kind for one in held])
    curved = np.array([one.path.curvature != 0.0 for one in held])
    groups = {"all": curved | True, "curves": curved, "side slopes": kinds == "cross_slope"}
    groups |= {kind: kinds == kind for kind in sorted(set(kinds.tolist()))}
    print_table(
        "Paths",
        ("paths", "number", "Brier", "plain", f"failed below {ACCEPTED:g}", "sure ones refused"),
        [summary(name, found.select(rows)) for name, rows in groups.items()],
    )
    if picture is not None:
        draw_picture(picture, found)


if __name__ == "__main__":
    typer.run(main)
