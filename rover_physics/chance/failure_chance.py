# SPDX-License-Identifier: Apache-2.0
"""The chance that a path fails: the share of a fixed set of samples in which it breaks a limit.

Poses that use less than FAR of every limit keep them in all samples, on uneven ground, where a
place a little aside has other contacts, those that use less than UNEVEN_FAR; what stands beside
them is looked for by some of them, ASIDE apart. So do those of which none around uses more than
NEAR with the least friction and torque of all samples, and all else off to either side. The others
are evaluated anew in each sample, with the contacts that they have at its place: samples that
share a place settle once. Drops and poses between waypoints are those of the prediction. On even
ground a share of the model's error counts. Where a sample would leave the known ground, the pose
stays at its place: what nobody knows is no failure.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_physics.chance.samples import (
    PlacedSamples,
    change_heights,
    draw_samples,
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
from rover_physics.results.record import (
    QUANTITIES,
    place_results,
    select_results,
    unwritten_results,
)
from rover_physics.results.uses import find_uses
from rover_physics.rover.extent import find_reach
from rover_physics.status import PoseStatus, Stall
from rover_physics.terrain.grid import Terrain, cut_around

SAMPLES, PLACES = 32, 8
"""Number of samples, and of the places at which the rover is in them."""
FAR = 0.5
"""Use of a limit below which no sample breaks it: it would have to double. Less where friction or
torque of a sample may be less than half."""
UNEVEN_FAR, AROUND = 0.25, 5.0
"""What FAR is where ground is uneven, and the distance along the path over which poses are around
each other [standard deviations of the position]."""
ASIDE = 0.5
"""Distance of the poses far from all limits that look aside [wheel radii]: what a wheel would roll
over is wider than that."""
NEAR = 0.95
"""Use with the least friction and torque of all samples below which no sample breaks a limit."""
EVEN, EVEN_SHARE = 0.1, 0.3
"""Difference of contact angles [rad] below which the ground is even, and the share of the model's
error that counts there: on a plane, forces follow from statics alone."""
SUMS = ("turn_off", "slide_off", "lift_height")
"""Quantities of limits that are sums along the path."""
OF_PATH = tuple(one.name for one in QUANTITIES if one.of_path)
"""Quantities that the path around a pose decides."""
OF_SLOTS = ("speed_share", "stalls")
"""Quantities that it decides if wheels are not on speed servos: whether one is wedged."""
OFF_KNOWN_GROUND = (PoseStatus.OFF_MAP, PoseStatus.UNKNOWN_GROUND)
"""States that a pose which is settled as told has only in samples that are beside it."""


@dataclass(frozen=True, eq=False)
class FailureChance:
    """The chance that a path fails, 0 to 1."""

    path: float
    """That it fails anywhere."""
    at: Floats
    """(n,) that it fails at a waypoint or on the way there from the one before."""
    limit: str
    """Title of the limit that breaks most often where it fails most often; empty where none does,
    or the rover most often does not settle."""
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
    records = model.records[-1:].copy()
    records["settings"]["control_margin"] = 0.0
    model, rows, n = replace(model, records=records), _all_rows(swept), len(swept.prediction.poses)
    groups = draw_samples(model.rover.uncertainty, SAMPLES, PLACES)
    if model.options.policy == OPTIMAL:
        groups = tuple(one.weaken() for one in groups)
    around = AROUND * model.rover.uncertainty.position if on_path else 0.0
    on_path &= model.on_servos
    asked, on_path = _find_asked(model, swept, rows, groups, on_path, around)
    settled = rows.results["status"] == PoseStatus.SETTLED
    failed = np.zeros((SAMPLES if len(asked) else 1, n), bool)
    failed[:, rows.waypoint[~settled]] = True
    causes = [*(row.title for row in model.limits.rows), ""]
    counts, done = np.zeros((n, len(causes)), np.int64), 0
    part = None if model.terrain.elevation_std is None else _cut_around(model, rows.poses)
    looked_at = np.flatnonzero(settled) if on_path else asked
    for group in groups if len(asked) else ():
        check_interruption()
        drawn = model if part is None else change_heights(model, part, group.number)
        found = _evaluate(drawn, rows, asked, n, group)
        for results in found:
            if on_path:
                every = _place(rows, asked, results)
                _write_path(drawn, swept, every)
                results = select_results(every, looked_at)
            broken = _find_causes(model, results)
            fails = broken.any(axis=1)
            waypoints = rows.waypoint[looked_at[fails]]
            failed[done, waypoints] = True
            np.add.at(counts, waypoints, broken[fails])
            done += 1
        if failed.any(axis=1).sum() > enough * SAMPLES:
            break
    at = failed.mean(axis=0)
    of_worst = counts[at.argmax()]
    cause = causes[of_worst.argmax()] if of_worst.any() else ""
    return FailureChance(float(failed.any(axis=1).mean()), at, cause, done in (0, SAMPLES))


def _find_causes(model: PackedModel, results: np.ndarray) -> NDArray[np.bool_]:
    """Return which limits RESULTs (n,) break, and in a last column whether they do not settle."""
    lost = (results["status"] != PoseStatus.SETTLED)[:, None]
    broken = find_uses(model.limits, results).use > 1.0
    return np.hstack([broken & ~lost, lost])


def _find_asked(
    model: PackedModel,
    swept: SweptPath,
    rows: Crossings,
    groups: tuple[PlacedSamples, ...],
    on_path: bool,
    around: float,
) -> tuple[NDArray[np.int64], bool]:
    """Return the indices of the rows that a sample may break, and whether the path decides there.

    What is found of a row counts for those within a distance [m] along the path, `around`. Where
    heights are uncertain, all that use more than FAR are asked.
    """
    worst_two, n = worst_of(groups), len(swept.prediction.poses)
    weakest = worst_two[0].samples[0]
    far = min(FAR, NEAR * min(weakest.friction[0], weakest.torque))
    settled = rows.results["status"] == PoseStatus.SETTLED
    is_even = _unevenness(rows.results) < EVEN
    near = _find_near(model, swept, rows.results, on_path, far)
    near |= ~is_even & _find_near(model, swept, rows.results, on_path, min(far, UNEVEN_FAR))
    near &= settled
    aside = np.zeros(len(near), bool)
    if worst_two[0].shift.any():
        spacing = ASIDE * model.rover.wheel.radius if around else 0.0
        aside[:n] = settled[:n] & ~near[:n] & _spread(swept.prediction.distance, spacing)
    is_exact = model.terrain.elevation_std is None
    tried = np.flatnonzero(aside | near & is_exact)
    if not len(tried):
        return np.flatnonzero(near), on_path
    closer = _find_near(model, swept, rows.results, on_path, NEAR)
    by_path = _needs_path(model, rows.results)
    for group in worst_two:
        found = _evaluate(model, rows, tried, n, group)[0]
        worst = _place(rows, tried, found)
        if on_path:
            _write_path(model, swept, worst)
        closer |= _find_near(model, swept, worst, on_path, NEAR)
        by_path |= _needs_path(model, worst)
    beside = closer & aside
    for marked in (closer, beside):
        marked[:n] |= _widen(marked[:n], swept.prediction.distance, around)
    asked = near & closer if is_exact else near
    return np.flatnonzero(asked | beside & settled), on_path and (by_path or not is_exact)


def _spread(distance: Floats, spacing: float) -> NDArray[np.bool_]:
    """Return waypoints (n,) a spacing [m] apart along the path; all of them for 0."""
    if spacing == 0.0:
        return np.ones(len(distance), bool)
    return np.asarray(np.diff(distance // spacing, prepend=-1.0) > 0.0)


def _widen(marked: NDArray[np.bool_], distance: Floats, around: float) -> NDArray[np.bool_]:
    """Return the waypoints (n,) within a distance [m] along the path of marked ones (n,)."""
    at = distance[marked]
    if not len(at):
        return marked
    following = np.searchsorted(at, distance).clip(max=len(at) - 1)
    apart = np.minimum(abs(at[following] - distance), abs(at[following - 1] - distance))
    return np.asarray(apart < around)


def _cut_around(model: PackedModel, poses: Floats) -> Terrain:
    """Return the part of the terrain that a rover at poses (n, 3), and a little off, may touch."""
    margin = find_reach(model.rover) + 6.0 * model.rover.uncertainty.position
    return cut_around(model.terrain, poses[:, :2], margin)


def _all_rows(swept: SweptPath) -> Crossings:
    """Return the waypoints, and then the poses between them."""
    prediction, n = swept.prediction, len(swept.prediction.poses)
    places = np.arange(float(n)), prediction.waypoint, none_held(n)
    waypoints = Crossings(*places, prediction.poses, prediction.results)
    return join_crossings([waypoints, swept.crossings])


def _unevenness(results: np.ndarray) -> Floats:
    """Return the difference of the wheels' contact angles (n,) [rad] at RESULTs."""
    angles = results["contact_angle"]
    return np.asarray(angles.max(axis=1) - angles.min(axis=1))


def _find_near(
    model: PackedModel, swept: SweptPath, results: np.ndarray, on_path: bool, least: float
) -> NDArray[np.bool_]:
    """Return the rows of RESULTs that use more than `least` of a limit, or lead to such a sum.

    Drift and lifts are sums along the path: the rows within a wheelbase before count, too.
    """
    uses = find_uses(model.limits, results).use
    near = np.fmax.reduce(uses, axis=1, initial=0.0) > least
    if not on_path:
        return near
    sums = [row.reads in SUMS for row in model.limits.rows]
    n, distance = len(swept.prediction.poses), swept.prediction.distance
    leads = np.zeros(n, bool)
    for i in np.flatnonzero(np.fmax.reduce(uses[:n][:, sums], axis=1, initial=0.0) > least):
        leads[np.searchsorted(distance, distance[i] - model.rover.wheelbase) : i + 1] = True
    return np.asarray(near | np.append(leads, leads[swept.crossings.waypoint]))


def _needs_path(model: PackedModel, results: np.ndarray) -> bool:
    """Return whether what only the path decides may break a limit at RESULTs, or save from that.

    These are drift and lifts, momentum and wedged wheels.
    """
    sums = [row.reads in SUMS for row in model.limits.rows]
    near = find_uses(model.limits, results).use[:, sums] > FAR
    wedged = results["stalls"] == Stall.WEDGED
    return bool(near.any() or results["deficit"].any() or wedged.any())


def _evaluate(
    model: PackedModel,
    rows: Crossings,
    asked: NDArray[np.int64],
    waypoints: int,
    group: PlacedSamples,
) -> Any:
    """Return the RESULTs (m, k) of asked rows in the m samples of a group.

    Poses between waypoints stay where they are: a peak of millimetres, as where a wheel leaves an
    edge, is met wherever the path is, and not a few millimetres beside it.
    """
    every, rows = rows, rows.select(asked)
    poses = np.where((asked < waypoints)[:, None], group.move(rows.poses), rows.poses)
    motions = np.ascontiguousarray(rows.results["motion"])
    results = unwritten_results(len(group.samples) * len(poses)).reshape(-1, len(poses))
    is_even = _unevenness(rows.results) < EVEN
    for share, own in ((EVEN_SHARE, is_even), (1.0, ~is_even)):
        here = np.flatnonzero(own)
        if len(here):
            variants = model.records[None].repeat(len(group.samples), axis=0)
            for sample, records in zip(group.samples, variants, strict=True):
                sample.add_error(share).change(records)
            found = model.evaluate_variants(variants, poses[here], motions[here], rows.held[here])
            for to, one in zip(results, found.T, strict=True):
                place_results(np.ascontiguousarray(one), to, here)
    for name in OF_PATH if model.on_servos else (*OF_PATH, *OF_SLOTS):
        results[name] = rows.results[name]
    results["torque_saturation"] /= np.array([[one.torques] for one in group.samples])
    if model.on_servos:
        results["torque_share"] = results["torque_saturation"].mean(axis=2)
    lost = np.isin(results["status"], OFF_KNOWN_GROUND).any(axis=0)
    if lost.any() and group.shift.any():
        stays = replace(group, shift=np.zeros(3))
        results[:, lost] = _evaluate(model, every, asked[lost], waypoints, stays)
    return results


def _place(rows: Crossings, asked: NDArray[np.int64], found: Any) -> Any:
    """Return the RESULTs of all rows, with those found where they were asked."""
    results = rows.results.copy()
    place_results(found, results, asked)
    return results


def _write_path(model: PackedModel, swept: SweptPath, results: Any) -> None:
    """Write what the path decides into the RESULTs of all rows."""
    n = len(swept.prediction.poses)
    crossings = swept.crossings._replace(results=results[n:])
    write_servo_path(model, swept.prediction.poses, results[:n], crossings)
