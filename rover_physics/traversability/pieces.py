# SPDX-License-Identifier: Apache-2.0
"""Judges many short pieces of path at once, as `judge_paths` does but faster.

A search asks about thousands of pieces and needs to know only whether each passes, and what it
costs. A piece fails if one of its waypoints, or a pose between them, breaks a limit; what is left
of it is then not looked at. With speed servos a piece passes only if no contact jumps and no wheel
may fall; about the others, and on maps with uncertain heights, `judge_paths` decides. The verdicts
are the same as its own.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rover_physics.bounds.path import is_uncertain
from rover_physics.limits.table import MAX_SLIDE, MAX_TURN_OFF
from rover_physics.numerics.arrays import view_read_only
from rover_physics.numerics.kernels import exact_kernel
from rover_physics.numerics.quiet import quiet
from rover_physics.prediction.crossing import find_crossings, find_turns, list_jumps, turn_wheels
from rover_physics.prediction.drops import MIN_ANGLE, find_drops, find_suspects, mark_failures
from rover_physics.prediction.halving import AtFailure
from rover_physics.prediction.known_poses import KnownPoses
from rover_physics.prediction.packed_model import PackedModel, pack_model
from rover_physics.prediction.path_kernels import Crossings, add_up, angle_ahead, distance_between
from rover_physics.prediction.path_motion import motions_of
from rover_physics.prediction.slots import stop_in_slots
from rover_physics.prediction.sweep import check_poses, joined_paths
from rover_physics.prediction.sweep_options import DEFAULT_OPTIONS, SweepOptions
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.results.record import place_results, select_results, unwritten_results
from rover_physics.results.uses import find_codes, find_risk, find_uses, limits_of
from rover_physics.rover.model import Rover
from rover_physics.rover.uncertainty import SIGMAS
from rover_physics.status import TorquePolicy
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.judge import judge_paths

SAFE = 0.5
"""Use of a limit up to which there is no exposure."""
STRIDE = 8
"""Every so many waypoints of a piece are evaluated first, then the others."""


@dataclass(frozen=True)
class PieceVerdict:
    """Verdict on a piece of path; time, energy and exposure are NaN if it fails."""

    code: str
    """Code of a limit that fails, empty if the rover may drive the piece."""
    time: float = math.nan
    """Time that it takes [s]."""
    energy: float = math.nan
    """Energy that it takes [J]."""
    exposure: float = math.nan
    """Exposure to the safety limits [s], see `find_exposure`."""


@quiet
def judge_pieces(
    rover: Rover,
    terrain: Terrain,
    pieces: Sequence[ArrayLike],
    options: SweepOptions = DEFAULT_OPTIONS,
    *,
    sigmas: float | None = SIGMAS,
    known: KnownPoses | None = None,
) -> list[PieceVerdict]:
    """Judge pieces of path as `judge_paths` does without the check for entrapment.

    The code of a piece that fails is that of one of its failures, not always of the first.

    Args:
        rover: The rover.
        terrain: The ground.
        pieces: Poses of each piece, (n, 3) x, y [m] and yaw [rad], map frame.
        options: As for `judge_paths`.
        sigmas: As for `judge_paths`.
        known: As for `judge_paths`.

    Returns:
        The verdict on each piece, in the order of `pieces`.

    Raises:
        PoseError, ModelError, SoilError: As `judge_paths`.
    """
    if not len(pieces):
        return []
    known = known or KnownPoses()
    model = pack_model(rover, terrain, options).remember(known)
    sweep = _Sweep(model, list(map(check_poses, pieces)))
    found = {k: PieceVerdict(code) for k, code in sweep.find_failures().items()}
    if not is_uncertain(terrain, sigmas):
        found |= sweep.look_between()
    rest = [k for k in range(len(pieces)) if k not in found]
    judged = judge_paths(
        rover,
        terrain,
        [pieces[k] for k in rest],
        options,
        sigmas=sigmas,
        stop_at_failure=True,
        check_entrapment=False,
        known=known,
    )
    for k, (prediction, verdict) in zip(rest, judged, strict=True):
        found[k] = PieceVerdict(verdict.code)
        if verdict.traversable:
            time, energy = float(prediction.time[-1]), float(prediction.energy[-1])
            found[k] = PieceVerdict("", time, energy, find_exposure(rover, prediction))
    return [found[k] for k in range(len(pieces))]


def find_exposure(rover: Rover, prediction: PathPrediction) -> float:
    """Return the exposure [s]: the integral over time of the squared excess over SAFE.

    The excess is (use - SAFE) / (1 - SAFE), 0 below SAFE and 1 at the limit and beyond.
    """
    uses = find_uses(limits_of(rover, prediction.policy), prediction.results)
    counts = uses.limits.records["is_risk"] > 0
    risk = np.fmax.reduce(uses.use[:, counts], axis=1, initial=0.0)
    excess = np.clip((risk - SAFE) / (1.0 - SAFE), 0.0, 1.0) ** 2
    return float(np.sum(0.5 * (excess[1:] + excess[:-1]) * np.diff(prediction.time)))


class _Sweep:
    """The waypoints of some pieces, evaluated as far as needed."""

    def __init__(self, model: PackedModel, pieces: Sequence[np.ndarray]):
        self._model = model
        self._counts = np.array([len(one) for one in pieces])
        self._poses = np.concatenate(pieces)
        self._motions = np.concatenate([motions_of(model, one) for one in pieces])
        self._results = unwritten_results(len(self._poses))
        self._is_open = np.ones(len(pieces), bool)

    def find_failures(self) -> dict[int, str]:
        """Return the codes of pieces with a waypoint that fails in any case, by index."""
        piece = np.repeat(np.arange(len(self._counts)), self._counts)
        ends = np.cumsum(self._counts)
        place = np.arange(len(piece)) - (ends - self._counts)[piece]
        coarse = (place % STRIDE == 0) | (place == self._counts[piece] - 1)
        codes: dict[int, str] = {}
        for chosen in (coarse, ~coarse):
            rows = np.flatnonzero(chosen & self._is_open[piece])
            if not len(rows):
                continue
            results = self._model.evaluate(self._poses[rows], motions=self._motions[rows])
            place_results(results, self._results, rows)
            codes |= self._close_failures(results, piece[rows])
        return codes

    def _close_failures(self, results: Any, piece: np.ndarray) -> dict[int, str]:
        """Return the codes of pieces with RESULTs (n,) that fail in any case, by index (n,)."""
        fails = np.zeros(len(piece), bool)
        records, limits = self._model.records, self._model.limits.records
        mark_failures(records, limits, view_read_only(results), fails)
        if not fails.any():
            return {}
        failed, first = np.unique(piece[fails], return_index=True)
        at = np.flatnonzero(fails)[first]
        found = find_codes(self._model.limits, select_results(results, at))
        codes = {k: code for k, code in zip(failed.tolist(), found, strict=True) if code}
        self._is_open[list(codes)] = False
        return codes

    def look_between(self) -> dict[int, PieceVerdict]:
        """Return the verdicts of pieces by what is between waypoints too, by index.

        With speed servos those are left out on which the path decides more than drops.
        `find_failures` must have evaluated the waypoints.
        """
        indices = np.flatnonzero(self._is_open)
        if not len(indices):
            return {}
        rows = np.flatnonzero(np.repeat(self._is_open, self._counts))
        ends = np.cumsum(self._counts[indices])
        poses, results = self._poses[rows], select_results(self._results, rows)
        between, unsure = self._find_between(poses, results, ends)
        owner = indices[np.searchsorted(ends, between.waypoint, side="right")]
        codes = self._close_failures(between.results, owner)
        found, sums = np.full((len(indices), 3), np.nan), np.empty((3, len(poses)))
        path = view_read_only(poses), view_read_only(results), ends
        inside = view_read_only(between.results), np.searchsorted(between.waypoint, ends)
        sum_up_pieces(self._model.records, self._model.limits.records, *path, *inside, sums, found)
        found[unsure, 0] = np.nan
        passes = found[:, 0] == found[:, 0]
        self._is_open[indices[passes]] = False
        if not self._model.on_servos:
            codes |= self._find_broken(results, np.repeat(indices, self._counts[indices]))
            codes |= self._find_broken(between.results, owner)
        verdicts = {k: PieceVerdict(code) for k, code in codes.items()}
        for k, row in zip(indices[passes].tolist(), found[passes].tolist(), strict=True):
            verdicts[k] = PieceVerdict("", *row)
        return verdicts

    def _find_broken(self, results: Any, piece: np.ndarray) -> dict[int, str]:
        """Return the codes of open pieces with RESULTs (n,) that break a limit, by index (n,).

        What the path decides must be written into the results.
        """
        rows = np.flatnonzero(self._is_open[piece])
        if not len(rows):
            return {}
        codes = find_codes(self._model.limits, select_results(results, rows))
        return {k: code for k, code in zip(piece[rows].tolist(), codes, strict=True) if code}

    def _find_between(
        self, poses: np.ndarray, results: Any, ends: np.ndarray
    ) -> tuple[Crossings, list[int]]:
        """Return the poses between the waypoints of open pieces, and pieces that need more.

        Drops are written into both RESULTs. With speed servos there are none: what is between
        waypoints may take time, too, so that only turns of wheels are looked at here.
        """
        model, joined = self._model, joined_paths(ends)
        if model.on_servos:
            jumps = list_jumps(model, poses, results, joined)
            far = find_turns(model, poses, results, joined)
            unsure = np.searchsorted(ends, np.append(jumps[:, 0], far[:, 0]), side="right")
            return turn_wheels(model, poses, results, joined), unsure.tolist()
        between = find_crossings(model, poses, results, joined, AtFailure.LEAVE_PATH)
        angles = np.where(results["wheel_speed"] < 0.0, -1.0, 1.0) * results["contact_angle"]
        steep = np.flatnonzero((angles < -MIN_ANGLE).any(axis=1))
        rows = np.append(between.waypoint, steep)
        for k in np.unique(np.searchsorted(ends, rows, side="right")).tolist():
            piece = slice(ends[k - 1] if k else 0, ends[k])
            inside = between.between(piece.start, piece.stop)
            drops = find_drops(model.records, poses[piece], results[piece], inside)
            results["wheel_drop"][piece] = drops.heights
            results["falling"][piece] = drops.at_waypoints
            inside.results["falling"] = drops.between
            stop_in_slots(results[piece], inside)
        return between, []


@exact_kernel
def sum_up_pieces(models, limits, poses, results, ends, others, other_ends, sums, found):
    """Write time, energy and exposure of the pieces that pass without a closer look.

    Args:
        models: (1,) MODEL, or more, of which the first counts.
        limits: (k,) LIMIT.
        poses: (n, 3) poses of all pieces.
        results: (n,) RESULT of each.
        ends: (k,) the rows where pieces end.
        others: (m,) RESULTs between the waypoints.
        other_ends: (k,) the rows where those of the pieces end.
        sums: (3, n) work space.
        found: (k, 3) time [s], energy [J] and exposure [s], written for pieces that pass.
    """
    first, first_other = 0, 0
    for k in range(ends.size):
        piece, inside = slice(first, ends[k]), slice(first_other, other_ends[k])
        first, first_other = ends[k], other_ends[k]
        if not (
            _is_easy(models, limits, results[piece])
            and _is_easy(models, limits, others[inside])
            and _keeps_to_path(models[0].linkage, poses[piece], results[piece])
        ):
            continue
        start = (0.0, 0.0, 0.0)
        last = add_up(models, poses[piece], results[piece], start, sums[:, piece])
        found[k, 0], found[k, 1] = last[1], last[2]
        found[k, 2] = add_exposure(limits, results[piece], sums[1, piece])


@exact_kernel
def add_exposure(limits, results, time):
    """Return the exposure [s] as `find_exposure`, of RESULTs (n,) at times (n,) [s]."""
    exposure, before = 0.0, 0.0
    for row in range(results.size):
        excess = (find_risk(results[row], limits) - SAFE) / (1.0 - SAFE)
        here = min(max(excess, 0.0), 1.0) ** 2
        if row > 0:
            exposure += 0.5 * (before + here) * (time[row] - time[row - 1])
        before = here
    return exposure


@exact_kernel
def _is_easy(models, limits, results):
    """Return whether no RESULT breaks a limit and, on servos, no wheel may fall or lift."""
    if find_suspects(models, limits, results)[0] >= 0:
        return False
    if models[0].settings.policy != TorquePolicy.SERVO:
        return True
    for row in range(results.size):
        for wheel in range(6):
            angle = angle_ahead(results[row], wheel)
            if angle < -MIN_ANGLE or results[row].lift_rate[wheel] > 0.0:
                return False
    return True


@exact_kernel
def _keeps_to_path(linkage, poses, results):
    """Return whether the deviations from the path stay small, whatever their directions."""
    turn, slide = 0.0, 0.0
    for row in range(1, results.size):
        distance = distance_between(poses[row - 1], poses[row], linkage.swing_radius)
        for i in range(row - 1, row + 1):
            x, y, rate = results[i].deviation[0], results[i].deviation[1], results[i].deviation[2]
            if x != 0.0 or y != 0.0 or rate != 0.0:
                share = 0.5 * distance / results[i].speed_share
                turn += share * abs(rate)
                slide += share * np.hypot(x, y)
    return turn <= MAX_TURN_OFF and slide <= MAX_SLIDE * linkage.length
