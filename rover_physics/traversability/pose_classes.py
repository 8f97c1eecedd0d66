# SPDX-License-Identifier: Apache-2.0
"""Traversability classes of many single poses, as numbers, for hazard maps and surveys."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from rover_physics.bounds.path import is_uncertain
from rover_physics.limits import table
from rover_physics.names import CONTROL_POLICIES, TORQUE_POLICIES
from rover_physics.numerics.arrays import view_read_only
from rover_physics.numerics.interruption import check_interruption
from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.quiet import quiet
from rover_physics.numerics.threads import CALLS_IN_WORK, limit_threads, run_in_turn
from rover_physics.prediction.evaluation import (
    AHEAD,
    CHUNK,
    MODEL,
    evaluate_stance,
    new_works,
    set_pose,
    stand,
)
from rover_physics.prediction.packed_model import pack_model
from rover_physics.prediction.sweep import check_poses
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.results.record import unwritten_results
from rover_physics.results.uses import RoverLimits, find_broken
from rover_physics.rover.model import Rover
from rover_physics.rover.uncertainty import SIGMAS
from rover_physics.status import PoseStatus
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability import classification
from rover_physics.traversability.classification import TRAVERSABILITY_CLASSES
from rover_physics.traversability.entrapment import UNKNOWN_CODES
from rover_physics.traversability.judge import judge_poses

UNKNOWN, IMPASSABLE = -1, TRAVERSABILITY_CLASSES.index(classification.IMPASSABLE)
"""Classes as numbers: off the known map, or no policy passes; else the index of the first that
passes in TORQUE_POLICIES. Those from 0 on are indices in TRAVERSABILITY_CLASSES, too."""
PART = 256
"""Number of poses that a thread takes at a time, some 3 ms of work on most ground; before each
part an interruption is possible."""


@dataclass(frozen=True, eq=False)
class RoverOnMap:
    """A rover on a map, and how it is judged."""

    rover: Rover
    """The rover."""
    terrain: Terrain
    """The map."""
    options: SweepOptions
    """Options of the model; their policy is ignored."""
    sigmas: float = SIGMAS
    """Standard deviations to allow for on an uncertain map."""

    @property
    def is_uncertain(self) -> bool:
        """True if the map has deviations of its heights that are allowed for."""
        return is_uncertain(self.terrain, self.sigmas)


def hopeless_codes(is_uncertain: bool) -> tuple[str, ...]:
    """Return the codes of what fails under every torque policy if it does under one.

    On a map whose heights may be wrong, these are only the codes of rows that do not settle: the
    worst case depends on the forces.
    """
    ground = ("steering", "off_map", "unknown_ground", "not_settled")
    if is_uncertain:
        return ground
    return (*ground, *(limit.code for limit in table.LIMITS if not limit.needs_forces))


@quiet
def classify_poses(
    on_map: RoverOnMap, poses: NDArray[np.float64], policies: Sequence[str] = TORQUE_POLICIES
) -> NDArray[np.int8]:
    """Return the class (n,) of single poses (n, 3) x, y [m] and yaw [rad], driving straight ahead.

    The class is that of `classify_judged` for the same pose, or UNKNOWN off the map and over
    unknown ground. Only `policies` are asked. On uncertain maps "servo" is not, as it has no
    bounds.

    Raises:
        PoseError, ModelError, SoilError: As `judge_poses`.
    """
    classes = np.full(len(poses), IMPASSABLE, np.int8)
    if not len(poses):
        return classes
    if on_map.is_uncertain:
        possible = [policy for policy in policies if policy in CONTROL_POLICIES]
        for first in range(0, len(poses), PART):
            part = slice(first, first + PART)
            classes[part] = _judge_classes(on_map, poses[part], possible)
    else:
        _find_classes(on_map, check_poses(poses), policies, classes)  # makes them contiguous
    return classes


def _judge_classes(
    on_map: RoverOnMap, poses: NDArray[np.float64], policies: Sequence[str]
) -> NDArray[np.int8]:
    """Return the classes (n,) of poses on a map whose heights may be wrong."""
    classes, rows = np.full(len(poses), IMPASSABLE, np.int8), np.arange(len(poses))
    for policy in policies:
        check_interruption()
        if not len(rows):
            break
        options = replace(on_map.options, policy=policy)
        _, verdict = judge_poses(
            on_map.rover, on_map.terrain, poses[rows], None, options, sigmas=on_map.sigmas
        )
        codes = np.array(verdict.codes)
        unknown = np.isin(codes, UNKNOWN_CODES)
        classes[rows[codes == ""]] = TORQUE_POLICIES.index(policy)
        classes[rows[unknown]] = UNKNOWN
        rows = rows[(codes != "") & ~unknown]
    return classes


def _find_classes(
    on_map: RoverOnMap,
    poses: NDArray[np.float64],
    policies: Sequence[str],
    classes: NDArray[np.int8],
) -> None:
    """Write the classes (n,) of poses (n, 3) on a map with exact heights."""
    packed = [
        pack_model(on_map.rover, on_map.terrain, replace(on_map.options, policy=policy))
        for policy in policies
    ]
    models = np.array([model.record for model in packed], MODEL)
    orders = [_without_forces_first(model.limits) for model in packed]
    limits, starts = view_read_only(np.concatenate(orders)), np.cumsum([0, *map(len, orders)])
    ranks = np.array([TORQUE_POLICIES.index(policy) for policy in policies])

    def parts(works: NDArray[np.void]) -> Iterator[Callable[[], None]]:
        results = unwritten_results(len(works))
        for k, first in enumerate(range(0, len(poses), PART)):
            check_interruption()
            part, own = slice(first, first + PART), k % len(works)
            space = works[own : own + 1], results[own : own + 1]
            asked = models, limits, starts, ranks, poses[part], AHEAD
            yield partial(classify_all, *asked, *space, classes[part])

    with limit_threads(packed[0].relative_cost(len(poses))) as threads:
        run_in_turn(parts(new_works(threads, CHUNK * CALLS_IN_WORK * threads)), threads)


def _without_forces_first(limits: RoverLimits) -> NDArray[np.void]:
    """Return LIMITs (k,), those that fail under every policy if they do under one first."""
    order = np.argsort(limits.records["needs_forces"], kind="stable")
    return np.asarray(limits.records[order])


@kernel
def classify_all(models, limits, starts, ranks, poses, motions, works, results, classes):
    """Find the classes of poses; each pose is settled once only.

    Args:
        models: (k,) MODELs of one rover on one ground.
        limits: The LIMITs of all, those without forces first.
        starts: (k + 1,) where those of each begin.
        ranks: (k,) the class of a pose that passes.
        poses: (n, 3) x, y [m] and yaw [rad] of the body origin.
        motions: Their motions, as for `evaluate`.
        works: (1,) WORK.
        results: (1,) RESULT, work space.
        classes: (n,) written.
    """
    work, result = works[0], results[0]
    for i in range(poses.shape[0]):
        set_pose(models[0], poses, motions, i, work)
        status = stand(models[0], work)
        classes[i] = IMPASSABLE
        if status == PoseStatus.OFF_MAP or status == PoseStatus.UNKNOWN_GROUND:
            classes[i] = UNKNOWN
        if status != PoseStatus.SETTLED:
            continue
        for k in range(models.size):
            evaluate_stance(models[k], work, status, result)
            if result.status != PoseStatus.SETTLED:
                continue
            own = limits[starts[k] : starts[k + 1]]
            broken = find_broken(result, own)[0]
            if broken < 0:
                classes[i] = ranks[k]
                break
            if not own[broken].needs_forces:
                break
