"""Compares predictions, verdicts, bounds and torques of two versions of the project.

Run from the repository, with another checkout of it:
    python -m benchmarks.same_bits OTHER_CHECKOUT [--python OTHER_CHECKOUT/.venv/bin/python]

Each version computes in a separate process, on the reference grounds and the map of Spirit's
landing site: both presets, both torque policies, soil, arm and tool load, uncertain heights, and
quadratic programs at random measured states. The output names every array that differs and its
difference, and counts the verdicts that changed. The exit code is 1 if any number differs by more
than TOLERANCE.
"""

import argparse
import importlib
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
TOLERANCE = 1e-12
"""Relative difference above which numbers count as different; allows for rounding errors."""
PLACES = {
    "load_rover": ("rover_physics.rover.rover_file", "rover_physics.rover"),
    "Terrain": ("rover_physics.terrain.grid", "rover_physics.terrain"),
    "judge_path": ("rover_physics.traversability.judge_path", "rover_physics.trap"),
    "score_poses": ("rover_physics.prediction.map_sweep", "rover_physics.map_sweep"),
    "judge_reach": ("rover_physics.traversability.reach", "rover_physics.reach"),
    "BoundStatus": ("rover_physics.status",),
    "SweepOptions": ("rover_physics.prediction.sweep_options",),
    "BalanceWriter": ("rover_physics.traction.balance", "rover_physics.traction_rows"),
    "MeasuredState": ("rover_physics.traction.balance", "rover_physics.traction_rows"),
    "ProgramInputs": ("rover_physics.traction.program_inputs",),
    "TractionWorkspace": ("rover_physics.traction.solver", "rover_physics.traction_solver"),
    "solve_traction": ("rover_physics.traction.solver", "rover_physics.traction_solver"),
}
"""Module of each name in this version, then in version 0.1."""
BOUND_STATUSES_BEFORE = (
    "BOUNDED", "NOT_SETTLED", "ON_EDGE", "UNKNOWN_NEAR", "OFF_MAP_NEAR", "SINGULAR",
)  # fmt: skip
"""Names of the status codes of bounds in version 0.1."""
ARM = {"arm_yaw": 0.3, "arm_shoulder": 0.2, "arm_elbow": 0.6}


def find(name: str) -> Any:
    """Return the object of that name in the version that runs, None if there is none."""
    for place in PLACES[name]:
        try:
            return getattr(importlib.import_module(place), name)
        except (ImportError, AttributeError):
            continue
    return None


def ask(function: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
    """Call a function and pass the options in the form that the running version expects."""
    sigmas = {"sigmas": options.pop("sigmas")} if "sigmas" in options else {}
    kind = find("SweepOptions")
    if kind is None:
        return function(*arguments, **options, **sigmas)
    return function(*arguments, kind(**options), **sigmas)


def read_grounds() -> Iterator[tuple[str, Any, np.ndarray]]:
    """Yield label, terrain and poses (n, 3): the reference cases, then a straight path."""
    terrain_of = find("Terrain")
    for file in ("settled_a", "settled_b"):
        with np.load(ROOT / "test" / "data" / f"{file}.npz") as entries:
            meta = json.loads(str(entries["meta"]))
            for name in sorted({row["terrain"] for row in meta["rows"]}):
                rows = [row for row in meta["rows"] if row["terrain"] == name]
                terrain = terrain_of(
                    entries[f"terrain_{name}"], meta["res"], tuple(meta["origin"])
                )
                poses = [[row["x"], row["y"], row["yaw"]] for row in rows]
                yield f"{file}/{name}", terrain, np.array(poses)
    with np.load(ROOT / "config" / "terrain" / "spirit_sol1352.npz") as entries:
        elevation, origin = entries["elevation"].astype(float), tuple(entries["origin"])
        terrain = terrain_of(elevation, float(entries["resolution"]), origin)
    row, column = np.argwhere(np.isfinite(elevation))[::997].T
    at = np.column_stack([column, row]) * terrain.resolution + origin
    yield "spirit", terrain, np.column_stack([at, np.linspace(-3.0, 3.0, len(at))])


def straight(length: float) -> np.ndarray:
    """Return poses (n, 3) along +x through the middle of a reference ground."""
    x = np.arange(-0.5 * length, 0.5 * length, 0.02)
    return np.column_stack([x, np.full_like(x, 0.1), np.full_like(x, 0.05)])


def list_cases(rover: str) -> dict[str, dict[str, Any]]:
    """Return the options of each case, by label."""
    cases: dict[str, dict[str, Any]] = {
        "equal": {},
        "optimal": {"policy": "optimal"},
        "slippery": {"policy": "optimal", "friction": 0.35, "max_torque": 0.8},
        "sand": {"soil": "dry_sand"},
        "sand backward": {"soil": "dry_sand", "policy": "optimal", "backward": True},
    }
    if rover == "lsr1":
        cases["arm"] = {"joint_angles": ARM, "payload": 0.4}
        cases["tool"] = {
            "joint_angles": ARM,
            "tool_force": (3.0, -2.0, 6.0),
            "tool_moment": (0.2, 0.1, -0.3),
        }
    return cases


def answer_all() -> dict[str, np.ndarray]:
    """Return all results of the version that runs, by label."""
    found: dict[str, np.ndarray] = {}
    for rover_name in ("lsr1", "m2020"):
        rover = find("load_rover")(rover_name)
        for ground, terrain, poses in read_grounds():
            where = f"{rover_name} | {ground}"
            paths = {"poses": poses}
            if ground != "spirit":
                paths["path"] = straight(2.4)
            for case, options in list_cases(rover_name).items():
                for path, at in paths.items():
                    judged = ask(find("judge_path"), rover, terrain, at, **options)
                    note_judged(found, f"{where} | {case} | {path}", *judged)
            note_uncertain(found, where, rover, terrain, paths)
            note_scores(found, where, rover, terrain)
        note_programs(found, rover_name, rover)
    note_reach(found)
    return found


def note_judged(found: dict[str, np.ndarray], label: str, prediction: Any, verdict: Any) -> None:
    """Store all arrays of a prediction and of its crossings, and the verdict."""
    note_arrays(found, label, prediction)
    if prediction.between is not None:
        note_arrays(found, f"{label} | between", prediction.between)
    if prediction.bounds is not None:
        note_arrays(found, f"{label} | bounds", prediction.bounds)
        names = [name_bound_status(int(code)) for code in prediction.bounds.status]
        found[f"{label} | bounds | status"] = np.array(names)
    told = [str(text) for text in (*verdict.codes, *verdict.reasons)]
    found[f"{label} | verdict"] = np.array([str(verdict.first_failure), *told])


def note_arrays(found: dict[str, np.ndarray], label: str, record: Any) -> None:
    """Store all numeric arrays of a record under `label`."""
    for name, value in vars(record).items():
        if isinstance(value, np.ndarray) and value.dtype != object:
            found[f"{label} | {name}"] = np.array(value)


def name_bound_status(code: int) -> str:
    """Return the name of a status of bounds; version 0.1 had other codes."""
    kind = find("BoundStatus")
    return str(kind(code).name) if kind else BOUND_STATUSES_BEFORE[code]


def note_uncertain(
    found: dict[str, np.ndarray], where: str, rover: Any, terrain: Any, paths: dict
) -> None:
    """Store the bounds for a standard deviation of 4 mm of all heights."""
    std = np.where(np.isfinite(terrain.elevation), 0.004, np.nan)
    uncertain = find("Terrain")(
        terrain.elevation, terrain.resolution, terrain.origin, elevation_std=std
    )
    for path, poses in paths.items():
        for policy in ("equal", "optimal"):
            judged = ask(find("judge_path"), rover, uncertain, poses, policy=policy, sigmas=2.0)
            note_judged(found, f"{where} | uncertain {policy} | {path}", *judged)


def note_scores(found: dict[str, np.ndarray], where: str, rover: Any, terrain: Any) -> None:
    """Store the scores of random poses on a ground."""
    rng = np.random.default_rng(3)
    xmin, xmax, ymin, ymax = terrain.bounds
    places = rng.uniform((xmin, ymin), (xmax, ymax), (2_500, 2))
    poses = np.column_stack([places, rng.uniform(-np.pi, np.pi, 2_500)])
    note_arrays(found, f"{where} | scores", ask(find("score_poses"), rover, terrain, poses))


def note_programs(found: dict[str, np.ndarray], name: str, rover: Any) -> None:
    """Store the torques of the quadratic program at random measured states."""
    rng = np.random.default_rng(7)
    writer, workspace = find("BalanceWriter")(rover), find("TractionWorkspace")()
    numbers = []
    for _ in range(300):
        state = find("MeasuredState")(
            *rng.uniform(-0.2, 0.2, 3), rng.uniform(-0.3, 0.3, 2), rng.uniform(-0.4, 0.4, 6)
        )
        rows = writer.write(state, float(rng.uniform(-0.1, 0.2) * writer.weight))
        inputs = rng.uniform(0.4, 1.0, 6), rover.wheel.max_torque, rover.wheel.radius
        kind = find("ProgramInputs")
        inputs = inputs if kind is None else (kind(*inputs),)
        answer = find("solve_traction")(workspace, rows, *inputs)
        numbers.append(
            [*rows.A.ravel(), *rows.b, *answer.torques, *answer.loads, *answer.utilisation,
             answer.friction_slack, answer.load_slack, answer.torque_slack, answer.iterations]
        )  # fmt: skip
    found[f"{name} | quadratic programs"] = np.array(numbers)


def note_reach(found: dict[str, np.ndarray]) -> None:
    """Store the arm's reach from a pose on rocks."""
    rover = find("load_rover")("lsr1")
    terrain = next(terrain for label, terrain, _ in read_grounds() if label == "settled_a/rocks")
    rng = np.random.default_rng(9)
    for k, target in enumerate(rng.uniform((0.1, -0.6, 0.0), (1.1, 0.6, 0.6), (40, 3))):
        answer = ask_reach(rover, terrain, target)
        found[f"reach {k}"] = np.array([json.dumps(answer.to_dict(), sort_keys=True)])


def ask_reach(rover: Any, terrain: Any, target: np.ndarray) -> Any:
    """Return whether the arm reaches a point (3,) [m] and can push there with 5 N."""
    judge = find("judge_reach")
    name = "tool_force" if find("SweepOptions") is None else "force"
    return judge(rover, terrain, (0.0, 0.0, 0.3), target, **{name: (0.0, 0.0, 5.0)})


def compare(before: dict[str, np.ndarray], after: dict[str, np.ndarray]) -> int:
    """Print the differences; return how many arrays differ by more than TOLERANCE."""
    numbers = same = rounded = 0
    differing: list[str] = []
    for label in sorted(before.keys() | after.keys()):
        if label not in before or label not in after:
            print(f"only {'after' if label in after else 'before'}: {label}")
            continue
        old, new = before[label], after[label]
        numbers += old.size
        if old.shape == new.shape and np.array_equal(old, new, equal_nan=old.dtype.kind == "f"):
            same += old.size
            continue
        far = measure_difference(old, new)
        if far <= TOLERANCE:
            rounded += 1
        else:
            differing.append(f"{label}: {far:.2g}")
    print(f"{numbers:,} values in {len(before):,} arrays; {same:,} are the same to the last bit")
    print(f"{rounded:,} arrays differ by at most {TOLERANCE:g} relative, {len(differing)} by more")
    for line in differing[:60]:
        print(" ", line)
    return len(differing)


def measure_difference(old: np.ndarray, new: np.ndarray) -> float:
    """Return the largest relative difference; infinity if text, shape or NaN differ."""
    if old.shape != new.shape or old.dtype.kind not in "fiub" or new.dtype.kind not in "fiub":
        return np.inf
    old, new = old.astype(float), new.astype(float)
    if not np.array_equal(np.isfinite(old), np.isfinite(new)):
        return np.inf
    known = np.isfinite(old)
    scale = max(float(np.abs(old[known]).max(initial=0.0)), 1e-30)
    return float(np.abs(old[known] - new[known]).max(initial=0.0)) / scale


def run_version(python: str, checkout: Path, out: Path) -> dict[str, np.ndarray]:
    """Run a checkout in a separate process and return the arrays that it wrote."""
    environment = {**os.environ, "PYTHONPATH": str(checkout)}
    command = [python, str(Path(__file__).resolve()), "--write", str(out)]
    subprocess.run(command, check=True, env=environment, cwd=checkout)
    with np.load(out) as entries:
        return {name: entries[name] for name in entries.files}


def main() -> int:
    """Run both versions and compare, or write the results of one."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("other", nargs="?", type=Path, help="a checkout of the other version")
    parser.add_argument("--python", default=sys.executable, help="interpreter of the other one")
    parser.add_argument("--write", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.write:
        np.savez(arguments.write, **answer_all())  # type: ignore[arg-type]
        return 0
    if arguments.other is None:
        parser.error("say which checkout to compare with")
    with tempfile.TemporaryDirectory() as folder:
        other = arguments.other.resolve()
        before = run_version(arguments.python, other, Path(folder, "before.npz"))
        after = run_version(sys.executable, ROOT, Path(folder, "after.npz"))
    return 1 if compare(before, after) else 0


if __name__ == "__main__":
    sys.exit(main())
