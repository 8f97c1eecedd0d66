"""Where the time of settling a pose goes: its parts, each timed at poses that are settled."""

from collections.abc import Callable

import numba
import numpy as np

from benchmarks.grounds import all_grounds, random_poses
from benchmarks.measure import Figure, median_times
from rover_physics.contact.contact_record import AGAIN, COARSE, FULL, NEAR, QUICK
from rover_physics.contact.rim_scan import scan_rim
from rover_physics.contact.settling import SLOPED, settle, write_gap_rates
from rover_physics.contact.wheel import blend_contact, find_contact
from rover_physics.prediction.evaluation import WORK, evaluate, new_work
from rover_physics.prediction.model_setup import set_up
from rover_physics.rover.linkage import place
from rover_physics.rover.rover_file import load_rover
from rover_physics.status import PoseStatus

POSES = 2_000
REPEATS = 15
compiled = numba.njit(nogil=True, error_model="numpy", fastmath={"contract"})


@compiled
def do_nothing(ground, linkage, samples, work):
    """Leave the rover placed."""


@compiled
def guess(ground, linkage, samples, work):
    """Make the first guess."""
    for wheel in range(6):
        find_contact(ground, samples, work.placement, wheel, COARSE, work.contacts)


@compiled
def sample(ground, linkage, samples, work):
    """Hold all samples of the rims against the ground."""
    for wheel in range(6):
        scan_rim(ground, samples, work.placement, wheel, QUICK, work.contacts)


@compiled
def look(ground, linkage, samples, work):
    """Hold all samples against the ground, and search around the nearest."""
    for wheel in range(6):
        find_contact(ground, samples, work.placement, wheel, QUICK, work.contacts)


@compiled
def look_and_step(ground, linkage, samples, work):
    """Work out a step of Newton's method, too, but for its solution."""
    look(ground, linkage, samples, work)
    write_gap_rates(linkage, work.placement, work.contacts, SLOPED, work.J)


@compiled
def look_near(ground, linkage, samples, work):
    """Search around the nearest places once more, as after a step."""
    look(ground, linkage, samples, work)
    for wheel in range(6):
        find_contact(ground, samples, work.placement, wheel, NEAR, work.contacts)


@compiled
def verify(ground, linkage, samples, work):
    """Verify that no other place of the rims is nearer."""
    look(ground, linkage, samples, work)
    for wheel in range(6):
        find_contact(ground, samples, work.placement, wheel, FULL, work.contacts)


@compiled
def verify_again(ground, linkage, samples, work):
    """Verify it once more at the circles that came near."""
    verify(ground, linkage, samples, work)
    for wheel in range(6):
        find_contact(ground, samples, work.placement, wheel, AGAIN, work.contacts)


@compiled
def share_load(ground, linkage, samples, work):
    """Find the mean contacts."""
    verify(ground, linkage, samples, work)
    for wheel in range(6):
        blend_contact(samples, work.placement, wheel, work.contacts)


PARTS = {
    "place all parts": (do_nothing, None),
    "first guess": (guess, do_nothing),
    "samples of six rims": (sample, do_nothing),
    "the same, and a search around the nearest": (look, do_nothing),
    "derivatives of the gaps": (look_and_step, look),
    "a search around the nearest": (look_near, look),
    "verification": (verify, look),
    "the same at circles that came near": (verify_again, verify),
    "mean contacts": (share_load, verify),
}
"""What is told: a part, and the one whose time is taken off."""


def loop_over_poses(part: Callable) -> Callable:
    """Return a kernel that places the rover at settled poses and does `part` there."""

    @compiled
    def run(grounds, linkages, samplings, poses, q, works):
        work = works[0]
        for i in range(len(poses)):
            place(linkages[0], poses[i, 0], poses[i, 1], poses[i, 2], q[i], work.placement)
            part(grounds[0], linkages[0], samplings[0], work)

    return run


@compiled
def settle_all(grounds, linkages, samplings, poses, q, works):
    """Settle at all poses, for comparison."""
    work = works[0]
    for i in range(len(poses)):
        settle(
            grounds[0], linkages[0], samplings[0], poses[i, 0], poses[i, 1], poses[i, 2],
            q[i], work.placement, work.contacts, work.J, work.step,
        )  # fmt: skip


def measure() -> list[Figure]:
    """Measure all parts on all grounds."""
    numba.set_num_threads(1)
    loops = {part: loop_over_poses(part) for part, _ in PARTS.values()}
    figures = []
    for name, ground in all_grounds().items():
        setup, poses = set_up(load_rover("lsr1"), ground), random_poses(ground, POSES)
        results = evaluate(*setup, poses)
        settled = results["status"] == PoseStatus.SETTLED
        poses, q = poses[settled], results["q"][settled].copy()
        records = (np.array([setup.linkage]), np.array([setup.samples]))
        works = np.full(1, new_work(), WORK)
        calls = [
            lambda run=run: run(setup.ground.records, *records, poses, q, works)  # noqa: B023
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
