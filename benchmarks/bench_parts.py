"""Times each part of settling a pose, at poses that are settled."""

from collections.abc import Callable

import numba
import numpy as np

from benchmarks.compiled import compiled
from benchmarks.grounds import all_grounds, random_poses
from benchmarks.measure import Figure, median_times
from rover_physics.contact.contact_record import SearchScope
from rover_physics.contact.gap_rates import GroundSlope, write_gap_rates
from rover_physics.contact.rim_scan import scan_rims
from rover_physics.contact.settling import settle
from rover_physics.contact.wheel import blend_contact, find_contact
from rover_physics.prediction.evaluation import AHEAD, WORK, evaluate, new_work, set_pose
from rover_physics.prediction.packed_model import pack_model
from rover_physics.rover.linkage import place
from rover_physics.rover.rover_file import load_rover
from rover_physics.status import PoseStatus

POSES = 2_000
"""Random poses on each ground."""
REPEATS = 15
"""Repeats of each measurement: differences of times need many."""


@compiled
def do_nothing(model, work):
    """Do nothing; this is the baseline with the rover placed."""


@compiled
def guess(model, work):
    """Make the first guess."""
    for wheel in range(6):
        find_contact(model, work, wheel, SearchScope.COARSE)


@compiled
def sample(model, work):
    """Compare all samples of the rims with the ground."""
    for wheel in range(6):
        scan_rims(model, work, wheel, SearchScope.QUICK)


@compiled
def look(model, work):
    """Compare all samples with the ground, and search around the nearest ones."""
    for wheel in range(6):
        find_contact(model, work, wheel, SearchScope.QUICK)


@compiled
def look_and_step(model, work):
    """Do the same, and compute the derivatives of a Newton step without solving it."""
    look(model, work)
    write_gap_rates(model.linkage, work.placement, work.contacts, GroundSlope.SLOPED, work.J)


@compiled
def look_near(model, work):
    """Search around the nearest samples once more, as after a Newton step."""
    look(model, work)
    for wheel in range(6):
        find_contact(model, work, wheel, SearchScope.NEAR)


@compiled
def verify(model, work):
    """Verify that no other ground below the wheels is nearer."""
    look(model, work)
    for wheel in range(6):
        find_contact(model, work, wheel, SearchScope.FULL)


@compiled
def share_load(model, work):
    """Find the mean contacts."""
    verify(model, work)
    for wheel in range(6):
        blend_contact(model, work, wheel)


PARTS = {
    "place all parts": (do_nothing, None),
    "first guess": (guess, do_nothing),
    "samples of six rims": (sample, do_nothing),
    "the same, and a search around the nearest": (look, do_nothing),
    "derivatives of the gaps": (look_and_step, look),
    "a search around the nearest": (look_near, look),
    "verification": (verify, look),
    "mean contacts": (share_load, verify),
}
"""By name: a kernel, and the kernel whose time is subtracted from its time."""


def loop_over_poses(part: Callable) -> Callable:
    """Return a kernel that places the rover at settled poses and runs `part` at each of them."""

    @compiled
    def run(models, poses, q, works):
        model, work = models[0], works[0]
        for i in range(len(poses)):
            place(model.linkage, poses[i], q[i], work.placement)
            part(model, work)

    return run


@compiled
def settle_all(models, poses, q, works):
    """Settle at all poses, for comparison."""
    for i in range(len(poses)):
        set_pose(models[0], poses, AHEAD, i, works[0])
        settle(models[0], works[0])


def measure() -> list[Figure]:
    """Measure all parts on all grounds."""
    numba.set_num_threads(1)
    loops = {part: loop_over_poses(part) for part, _ in PARTS.values()}
    figures = []
    for name, ground in all_grounds().items():
        model, poses = pack_model(load_rover("lsr1"), ground), random_poses(ground, POSES)
        results = evaluate(model.records, poses)
        settled = results["status"] == PoseStatus.SETTLED
        poses, q = poses[settled], results["q"][settled].copy()
        works = np.full(1, new_work(), WORK)
        calls = [
            lambda run=run: run(model.records, poses, q, works)  # noqa: B023
            for run in (*loops.values(), settle_all)
        ]
        times = median_times(calls, REPEATS)
        per_pose = {k: 1e6 * t / len(poses) for k, t in zip(loops, times[:-1], strict=True)}
        for what, (part, without) in PARTS.items():
            taken = per_pose[part] - (per_pose[without] if without else 0.0)
            figures.append(Figure("parts", f"{name}: {what}", taken, "us", repeats=REPEATS))
        whole = 1e6 * times[-1] / len(poses)
        figures.append(Figure("parts", f"{name}: settling", whole, "us", repeats=REPEATS))
    return figures
