# SPDX-License-Identifier: Apache-2.0
"""The chance that a path fails: the share of a fixed set of samples in which it breaks a limit.

Poses that use less than FAR of every limit keep them in all samples. So do those that use less
than NEAR with the least friction and torque of all samples, and all else off to either side. The
others are evaluated anew in each sample, with the contacts that they have there. Drops and poses
between waypoints are those of the prediction. On even ground a share of the model's error counts.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rover_physics.chance.samples import (
    Sample,
    change_heights,
    cut_around,
    draw_samples,
    sort_by_strength,
    worst_of,
)
from rover_physics.errors import ModelError
from rover_physics.names import OPTIMAL
from rover_physics.numerics.arrays import Floats, freeze_fields
from rover_physics.numerics.interruption import check_interruption
from rover_physics.prediction.packed_model import PackedModel
from rover_physics.prediction.path_kernels import Crossings, join_crossings, none_held
from rover_physics.prediction.servo_path import write_servo_path
from rover_physics.prediction.sweep import SweptPath
from rover_physics.results.record import place_results, unwritten_results
from rover_physics.results.uses import find_uses
from rover_physics.status import PoseStatus, Stall
from rover_physics.terrain.grid import Terrain

SAMPLES = 32
"""Number of samples."""
FAR = 0.5
"""Use of a limit below which no sample breaks it: it would have to double. Less where friction or
torque of a sample may be less than half."""
NEAR = 0.95
"""Use with the least friction and torque of all samples below which no sample breaks a limit."""
EVEN, EVEN_SHARE = 0.1, 0.3
"""Difference of contact angles [rad] below which the ground is even, and the share of the model's
error that counts there: on a plane, forces follow from statics alone."""
SUMS = ("turn_off", "slide_off", "lift_height")
"""Quantities of limits that are sums along the path."""
OF_PATH = ("falling", "wheel_drop", "drift", "lift_height")
"""Quantities that the path around a pose decides."""


@dataclass(frozen=True, eq=False)
class FailureChance:
    """The chance that a path fails, 0 to 1."""

    path: float
    """That it fails anywhere."""
    at: Floats
    """(n,) that it fails at a waypoint or on the way there from the one before."""
    limit: str
    """Title of the limit that breaks most often where it fails most often; empty for none."""
    is_whole: bool = True
    """False if not all samples were asked: the chances may be larger."""

    def __post_init__(self) -> None:
        freeze_fields(self)


def check_accepted_chance(chance: float | None) -> None:
    """Check the largest chance of failure that is accepted; None does not ask for it.

    Raises:
        ModelError: It is no chance.
    """
    if chance is not None and not 0.0 <= chance <= 1.0:
        raise ModelError(f"accepted_chance is {chance}; it must be a chance, 0 to 1")


def find_failure_chance(
    model: PackedModel, swept: SweptPath, on_path: bool = True, enough: float = 1.0
) -> FailureChance:
    """Return the chance that a swept path fails; 1 where the rover does not settle.

    A control margin is not asked of samples: it is left for what they hold.

    Args:
        model: The model of the sweep.
        swept: All of the path.
        on_path: Whether its poses form a path; if not, there is no drift.
        enough: Chance above which it need not be known: the samples end there, and those that are
            left count as if they passed.
    """
    n = len(swept.prediction.poses)
    rows, records = _all_rows(swept), model.records[-1:].copy()
    records["settings"]["control_margin"] = 0.0
    model = replace(model, records=records)
    settled = rows.results["status"] == PoseStatus.SETTLED
    samples = draw_samples(model.rover.uncertainty, SAMPLES)
    if model.options.policy == OPTIMAL:
        samples = tuple(one.weaken() for one in samples)
    samples = sort_by_strength(samples)
    if enough < 0.5:
        samples = samples[::-1]  # those with the least friction and torque refuse first
    worst_two = worst_of(samples)
    far = min(FAR, NEAR * min(worst_two[0].friction[0], worst_two[0].torque))
    near = settled & _find_near(model, swept, rows.results, on_path, far)
    is_exact = model.terrain.elevation_std is None
    if near.any() and is_exact:
        closer = _find_near(model, swept, rows.results, on_path, NEAR)
        summed = _needs_path(model, rows.results)
        for sample in worst_two:
            worst = _evaluate_near(model, swept, sample, (rows, near), on_path)
            closer |= _find_near(model, swept, worst, on_path, NEAR)
            summed |= _needs_path(model, worst)
        near &= closer
        on_path &= summed
    failed = np.zeros((SAMPLES if near.any() else 1, n), bool)
    failed[:, rows.waypoint[~settled]] = True
    counts, is_whole = np.zeros((n, len(model.limits)), np.int64), True
    part = model.terrain if is_exact else _cut_around(model, rows.poses)
    for k, sample in enumerate(samples if near.any() else ()):
        check_interruption()
        drawn = model if is_exact else change_heights(model, part, k)
        results = _evaluate_near(drawn, swept, sample, (rows, near), on_path)
        asked = np.flatnonzero(near | _differ(results, rows.results))
        broken = find_uses(model.limits, results[asked]).use > 1.0
        fails = broken.any(axis=1)
        waypoints = rows.waypoint[asked[fails]]
        failed[k, waypoints] = True
        np.add.at(counts, waypoints, broken[fails])
        if failed.any(axis=1).sum() > enough * SAMPLES:
            is_whole = k == SAMPLES - 1
            break
    at = failed.mean(axis=0)
    place = int(at.argmax())
    most = int(counts[place].argmax())
    limit = model.limits.rows[most].title if counts[place, most] else ""
    return FailureChance(float(failed.any(axis=1).mean()), at, limit, is_whole)


def _differ(results: np.ndarray, others: np.ndarray) -> NDArray[np.bool_]:
    """Return for each row (n,) whether two RESULTs of it differ."""
    whole = f"V{results.itemsize}"
    return np.asarray(results.view(whole) != others.view(whole))


def _cut_around(model: PackedModel, poses: Floats) -> Terrain:
    """Return the part of the terrain that a rover at poses (n, 3), and a little off, may touch."""
    wheels, told = model.wheels, model.rover.uncertainty
    return cut_around(
        model.terrain,
        poses[:, :2],
        wheels.swing_radius + 2.0 * wheels.radius + 6.0 * told.position,
    )


def _all_rows(swept: SweptPath) -> Crossings:
    """Return the waypoints, and then the poses between them."""
    prediction, n = swept.prediction, len(swept.prediction.poses)
    places = np.arange(float(n)), prediction.waypoint, none_held(n)
    waypoints = Crossings(*places, prediction.poses, prediction.results)
    return join_crossings([waypoints, swept.crossings])


def _find_near(
    model: PackedModel, swept: SweptPath, results: np.ndarray, on_path: bool, least: float
) -> NDArray[np.bool_]:
    """Return the rows of RESULTs that use more than `least` of a limit, or lead to such a sum.

    Drift and lifts are sums along the path: the rows within a wheelbase before count, too.
    """
    uses = find_uses(model.limits, results).use
    near = np.fmax.reduce(uses, axis=1, initial=0.0) > least
    if not (on_path and model.wheels.on_servos):
        return near
    sums = [row.reads in SUMS for row in model.limits.rows]
    n, distance = len(swept.prediction.poses), swept.prediction.distance
    window, leads = float(model.record.linkage.length), np.zeros(n, bool)
    for i in np.flatnonzero(np.fmax.reduce(uses[:n][:, sums], axis=1, initial=0.0) > least):
        leads[np.searchsorted(distance, distance[i] - window) : i + 1] = True
    return np.asarray(near | np.append(leads, leads[swept.crossings.waypoint]))


def _needs_path(model: PackedModel, results: np.ndarray) -> bool:
    """Return whether what only the path decides may break a limit at RESULTs, or save from that.

    These are drift and lifts, momentum and wedged wheels.
    """
    sums = [row.reads in SUMS for row in model.limits.rows]
    near = find_uses(model.limits, results).use[:, sums] > FAR
    wedged = results["stalls"] == Stall.WEDGED
    return bool(near.any() or results["deficit"].any() or wedged.any())


def _evaluate_near(
    model: PackedModel,
    swept: SweptPath,
    sample: Sample,
    chosen: tuple[Crossings, NDArray[np.bool_]],
    on_path: bool,
) -> np.ndarray:
    """Return the RESULTs of all rows: those where the mask is True evaluated in a sample.

    Poses between waypoints stay where they are: a peak of millimetres, as where a wheel leaves an
    edge, is met wherever the path is, and not a few millimetres beside it.
    """
    all_rows, near = chosen
    chosen_rows = np.flatnonzero(near)
    rows, all_results = all_rows.select(chosen_rows), all_rows.results.copy()
    between = chosen_rows >= len(swept.prediction.poses)
    poses = np.where(between[:, None], rows.poses, sample.move(rows.poses))
    motions = np.ascontiguousarray(rows.results["motion"])
    results = unwritten_results(len(poses))
    angles = rows.results["contact_angle"]
    is_even = angles.max(axis=1) - angles.min(axis=1) < EVEN
    for share, own in ((EVEN_SHARE, is_even), (1.0, ~is_even)):
        here = np.flatnonzero(own)
        if len(here):
            changed = sample.add_error(share).change(model)
            found = changed.evaluate(poses[here], rows.held[here], motions[here])
            place_results(found, results, here)
    for name in OF_PATH:
        results[name] = rows.results[name]
    results["torque_saturation"] /= sample.torques
    if model.wheels.on_servos:
        results["torque_share"] = results["torque_saturation"].mean(axis=1)
    place_results(results, all_results, near)
    if on_path and model.wheels.on_servos:
        n = len(swept.prediction.poses)
        crossings = swept.crossings._replace(results=all_results[n:])
        write_servo_path(model, swept.prediction.poses, all_results[:n], crossings)
    return np.asarray(all_results)
