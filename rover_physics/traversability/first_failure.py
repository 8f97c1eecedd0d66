"""Sweeps of paths that end at the first failure: no pose is evaluated far beyond it.

A path is swept in blocks, each longer than the one before. Rows that may break a limit are found
by a kernel that errs on the safe side; only if there is one is the path so far judged.
"""

import time
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rover_physics.forces.servo import MIN_SPEED_SHARE
from rover_physics.forces.soil import MODERATE_SINKAGE
from rover_physics.numerics.interruption import check_interruption
from rover_physics.numerics.kernels import exact_kernel
from rover_physics.numerics.quiet import quiet
from rover_physics.numerics.read_only import view_read_only
from rover_physics.numerics.threads import limit_threads
from rover_physics.prediction.crossing import (
    Crossings,
    find_crossings,
    join_crossings,
    join_results,
    place_results,
)
from rover_physics.prediction.drops import MIN_ANGLE, find_falls
from rover_physics.prediction.evaluation import effort, unwritten_results
from rover_physics.prediction.packed_model import PackedModel, pack_model
from rover_physics.prediction.path_motion import path_motions
from rover_physics.prediction.sweep import (
    SweptPath,
    check_poses,
    evaluator,
    joined_paths,
    make_prediction,
    wheels_of,
)
from rover_physics.prediction.sweep_options import DEFAULT_OPTIONS, SweepOptions
from rover_physics.rover.model import Rover
from rover_physics.status import PoseStatus, TorquePolicy
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.verdict import Verdict, find_first_failure, judge

FIRST_BLOCK = 32
"""Number of waypoints of a path that are evaluated first."""
MIN_GROWTH, MAX_GROWTH = 2.0, 16.0
"""Bounds of the length of a block over that of the block before."""
BLOCK_TIME = 3e-3
"""Time [s] that a block aims at, about ten times what a block costs beside its poses. What is
found does not depend on the blocks."""


class SuspectLimits(NamedTuple):
    """Limits of a rover, without tolerance, as the kernel reads them."""

    least_rocker: float
    """[rad]"""
    most_rocker: float
    """[rad]"""
    least_bogie: float
    """[rad]"""
    most_bogie: float
    """[rad]"""
    tilt: float
    """[rad]"""
    tip_over_ratio: float
    """Least ratio."""
    belly_clearance: float
    """Least clearance [m]; NaN breaks no limit."""
    sinkage: float
    """Largest sinkage [m]."""
    friction: float
    """Largest friction utilisation, less the control margin."""
    torque: float
    """Largest torque saturation, less the control margin."""
    speed_share: float
    """Least share of the commanded motion."""


@quiet
def sweep_until_failure(
    rover: Rover,
    terrain: Terrain,
    paths: Sequence[ArrayLike],
    options: SweepOptions = DEFAULT_OPTIONS,
) -> list[tuple[SweptPath, Verdict]]:
    """Sweep several paths at once, each up to its first failure.

    Args:
        rover: The rover.
        terrain: The ground.
        paths: Poses of each path, (n, 3) x, y [m] and yaw [rad].
        options: As for `sweep_path`.

    Returns:
        For each path the prediction and the verdict of `judge`. They end with the first waypoint
        that fails; up to there they are those of the whole path.

    Raises:
        PoseError, ModelError, SoilError: As `sweep_path`.
    """
    model = pack_model(rover, terrain, options)
    started = [_StartedPath(rover, model, check_poses(poses)) for poses in paths]
    going, block = started, FIRST_BLOCK
    with limit_threads(effort(model.settings, sum(len(path.poses) for path in started))):
        while going:
            check_interruption()
            began = time.perf_counter()
            _evaluate_block(model, going, block)
            _search_crossings(terrain, model, going)
            for path in going:
                path.look_for_failure()
            going = [path for path in going if path.judged is None]
            growth = BLOCK_TIME / max(time.perf_counter() - began, 1e-9)
            block = round(block * min(max(growth, MIN_GROWTH), MAX_GROWTH))
    return [path.judged for path in started if path.judged is not None]


class _StartedPath:
    """A path of which the first waypoints are swept."""

    def __init__(self, rover: Rover, model: PackedModel, poses: np.ndarray):
        self._rover, self._model, self.poses = rover, model, poses
        self.motions = path_motions(model, poses)
        self.results = unwritten_results(len(poses))
        """(n,) RESULT of each waypoint; the first `evaluated` are written."""
        self.evaluated = 0
        self.searched = 0
        """Number of waypoints up to which the crossings are known."""
        self.judged: tuple[SweptPath, Verdict] | None = None
        """The result once it is known."""
        self._limits = suspect_limits_of(rover, model)
        self._suspicious = False
        self._crossings: list[Crossings] = []

    def block(self, size: int) -> slice:
        """Return the waypoints to evaluate next; none while evaluated ones are not searched."""
        if self.searched < self.evaluated:
            return slice(self.evaluated, self.evaluated)
        return slice(self.evaluated, min(self.evaluated + size, len(self.poses)))

    def stretch(self) -> slice:
        """Return the waypoints between which to search crossings next, up to a sure failure."""
        news = view_read_only(self.results[self.searched : self.evaluated])
        suspect, failure = find_suspects(news, self._limits)
        end = self.evaluated if failure < 0 else self.searched + failure + 1
        self._suspicious |= 0 <= suspect < end - self.searched
        first = max(self.searched - 1, 0)
        self.searched = end
        return slice(first, end)

    def take_crossings(self, crossings: Crossings) -> None:
        """Keep the crossings of the last stretch, whose places count from the path's start."""
        self._crossings.append(crossings)
        between = view_read_only(crossings.results)
        self._suspicious |= bool(find_suspects(between, self._limits)[0] >= 0)

    def look_for_failure(self) -> None:
        """Judge the path so far if it is complete, or if a waypoint on it may fail."""
        end, crossings = self.searched, join_crossings(self._crossings)
        self._crossings = [crossings]
        complete = end == len(self.poses)
        here, results = self.poses[:end], self.results[:end]
        if not (complete or self._suspicious):
            if not len(crossings.place):
                return
            falls = find_falls(wheels_of(self._model), here, results, crossings)
            if not falls.drops.max() > self._rover.limits.wheel_drop:
                return
        swept, falls = make_prediction(self._model, here, results, crossings)
        failure = find_first_failure(self._rover, swept.prediction)
        if complete and failure < 0:
            self.judged = swept, judge(self._rover, swept.prediction)
        elif failure >= 0 and (complete or failure < falls.decided):
            swept = swept.cut(failure + 1)
            self.judged = swept, judge(self._rover, swept.prediction)


def suspect_limits_of(rover: Rover, model: PackedModel) -> SuspectLimits:
    """Return the limits of a rover under the options of a model."""
    limits, suspension = rover.limits, rover.suspension
    kept = 1.0 - float(model.settings.control_margin)
    on_servos = bool(model.settings.policy == TorquePolicy.SERVO)
    return SuspectLimits(
        least_rocker=float(suspension.rocker_limits[0]),
        most_rocker=float(suspension.rocker_limits[1]),
        least_bogie=float(suspension.bogie_limits[0]),
        most_bogie=float(suspension.bogie_limits[1]),
        tilt=float(limits.tilt),
        tip_over_ratio=float(limits.tip_over_ratio),
        belly_clearance=float(limits.belly_clearance),
        sinkage=float(MODERATE_SINKAGE * 2.0 * rover.wheel.radius),
        friction=float("inf") if on_servos else float(limits.friction_utilisation * kept),
        torque=float("inf") if on_servos else float(limits.torque_saturation * kept),
        speed_share=float(MIN_SPEED_SHARE),
    )


def _evaluate_block(model: PackedModel, paths: Sequence[_StartedPath], size: int) -> None:
    """Evaluate the next waypoints of all paths together."""
    blocks = [path.block(size) for path in paths]
    pairs = list(zip(paths, blocks, strict=True))
    at = np.concatenate([path.poses[block] for path, block in pairs])
    if not len(at):
        return
    motions = np.concatenate([path.motions[block] for path, block in pairs])
    results, first = evaluator(model)(at, motions=motions), 0
    for path, block in pairs:
        end = first + block.stop - block.start
        place_results(results[first:end], path.results, block)
        path.evaluated, first = block.stop, end


def _search_crossings(terrain: Terrain, model: PackedModel, paths: Sequence[_StartedPath]) -> None:
    """Search the crossings of the next stretches of all paths together."""
    stretches = [path.stretch() for path in paths]
    pairs = list(zip(paths, stretches, strict=True))
    ends = np.cumsum([stretch.stop - stretch.start for stretch in stretches])
    crossings = find_crossings(
        terrain,
        wheels_of(model),
        np.concatenate([path.poses[stretch] for path, stretch in pairs]),
        join_results([path.results[stretch] for path, stretch in pairs]),
        evaluator(model),
        joined_paths(ends),
    )
    for (path, stretch), first, end in zip(pairs, [0, *ends[:-1]], ends, strict=True):
        path.take_crossings(crossings.between(first, end).moved(stretch.start))


@exact_kernel
def find_suspects(results, limits):
    """Return the first row that may break a limit, and the first that does so in any case; or -1.

    A wheel that rolls off an edge needs no equilibrium, so a row with a contact that is behind a
    wheel and steep may keep the limits. Wheel drops are not checked.

    Args:
        results: (n,) RESULT.
        limits: SuspectLimits.
    """
    suspect = -1
    for row in range(results.size):
        result = results[row]
        if result.status != PoseStatus.SETTLED or not stands_safely(result, limits):
            return (row if suspect < 0 else suspect), row
        if not has_grip(result, limits):
            suspect = row if suspect < 0 else suspect
            if not _may_fall(result):
                return suspect, row
    return suspect, -1


@exact_kernel
def stands_safely(result, limits):
    """Return whether suspension, tilt, tip-over ratio and clearance keep their limits."""
    q = result.q
    rocker = min(q[3], -q[3]) >= limits.least_rocker and max(q[3], -q[3]) <= limits.most_rocker
    bogie = min(q[4], q[5]) >= limits.least_bogie and max(q[4], q[5]) <= limits.most_bogie
    upright = np.cos(q[1]) * np.cos(q[2])
    tilt = np.arccos(min(max(upright, -1.0), 1.0))
    low = result.belly_clearance < limits.belly_clearance
    stable = result.tip_over_ratio >= limits.tip_over_ratio
    return rocker and bogie and tilt <= limits.tilt and stable and not low


@exact_kernel
def has_grip(result, limits):
    """Return whether load, sinkage, friction and torque of all wheels keep their limits.

    So must the speed of a rover with speed servos.
    """
    if not result.speed_share >= limits.speed_share:
        return False
    for wheel in range(6):
        loaded = result.wheel_loads[wheel] >= 0.0
        use, torque = result.friction_utilisation[wheel], result.torque_saturation[wheel]
        held = use <= limits.friction and torque <= limits.torque
        if not (loaded and held and result.sinkage[wheel] <= limits.sinkage):
            return False
    return True


@exact_kernel
def _may_fall(result):
    """Return whether a contact is so far behind its wheel that the wheel may roll off an edge."""
    steepest = 0.0
    for wheel in range(6):
        angle = result.contact_angle[wheel]
        steepest = min(steepest, -angle if result.wheel_speed[wheel] < 0.0 else angle)
    return steepest < -MIN_ANGLE
