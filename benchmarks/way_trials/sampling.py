"""First ways by a sampling planner of OMPL on the same model, to compare the times.

The states are those of Reeds and Shepp's car with the rover's tightest radius. A state is valid if
the rover can stand there, a motion if the model passes it as a piece of path.
"""

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from ompl import base, geometric, util

from benchmarks.way_trials.grounds import Case, Pair
from rover_physics.rover.turning import tightest_radius
from rover_planner.planning.lattice.judge import Judge
from rover_planner.planning.lattice.primitives import Gear

PLANNERS = ("BITstar", "RRTConnect", "RRTstar")
"""Planners of OMPL that can be asked for."""
PATIENCE = 3.0
"""Time by the clock over CPU time after which a planner that waits is stopped."""


@dataclass(frozen=True)
class Sampled:
    """What the sampling planner found."""

    seconds: float
    """Time by the clock [s], to the first way or until it gave up."""
    cpu: float
    """CPU time of the same [s]."""
    length: float
    """Length of the way [m], NaN without one."""
    poses: int
    """Number of poses that the model was asked about."""


class _Motions(base.MotionValidator):
    """Judges the motion between two states with the model."""

    def __init__(self, information: Any, judge: Judge):
        super().__init__(information)
        self._space, self._judge = information.getStateSpace(), judge
        self._state = self._space.allocState()

    def checkMotion(self, first: Any, last: Any, *_: Any) -> bool:  # noqa: N802 - OMPL's name
        """Return whether the rover may drive from one state to another."""
        spacing = self._judge.options.waypoint_spacing
        pieces = max(1, int(np.ceil(self._space.distance(first, last) / spacing)))
        state, poses = self._state, np.empty((pieces + 1, 3))
        for row in range(pieces + 1):
            self._space.interpolate(first, last, row / pieces, state)
            poses[row] = state.getX(), state.getY(), state.getYaw()
        return not self._judge.judge([poses], [Gear.FORWARD])[0].code


def sample_way(case: Case, pair: Pair, planner: str, seconds: float, seed: int) -> Sampled:
    """Return the first way that a sampling planner finds within some seconds.

    Args:
        case: The rover on its ground.
        pair: Start and goal.
        planner: One of PLANNERS.
        seconds: CPU time after which it gives up [s].
        seed: Seed of OMPL's random numbers; only the first of a process counts.
    """
    util.setLogLevel(util.LogLevel.LOG_ERROR)
    util.RNG.setSeed(seed)
    judge, began = case.judge, (time.perf_counter(), time.process_time())
    setup, *kept = _set_up(case, judge, pair)
    kept.append(getattr(geometric, planner)(setup.getSpaceInformation()))
    setup.setPlanner(kept[-1])
    ends = began[0] + PATIENCE * seconds, began[1] + seconds
    kept.append(
        base.PlannerTerminationCondition(
            lambda: time.process_time() > ends[1] or time.perf_counter() > ends[0]
        )
    )
    setup.solve(kept[-1])
    taken = time.perf_counter() - began[0], time.process_time() - began[1]
    found = setup.haveExactSolutionPath()
    length = setup.getSolutionPath().length() if found else np.nan
    return Sampled(*taken, float(length), judge.poses)


def _set_up(case: Case, judge: Judge, pair: Pair) -> tuple[Any, ...]:
    """Return the problem for OMPL, any way will do, and objects that must live as long as it."""
    space = base.ReedsSheppStateSpace(tightest_radius(case.rover))
    xmin, xmax, ymin, ymax = case.terrain.bounds
    bounds = base.RealVectorBounds(2)
    for axis, (low, high) in enumerate(((xmin, xmax), (ymin, ymax))):
        bounds.setLow(axis, low)
        bounds.setHigh(axis, high)
    space.setBounds(bounds)
    setup = geometric.SimpleSetup(space)
    information = setup.getSpaceInformation()
    setup.setStateValidityChecker(lambda state: _stands(judge, state))
    motions = _Motions(information, judge)
    information.setMotionValidator(motions)
    states = []
    for pose in pair:
        state = space.allocState()
        state.setX(float(pose[0]))
        state.setY(float(pose[1]))
        state.setYaw(float(pose[2]))
        states.append(state)
    setup.setStartAndGoalStates(*states)
    objective = base.PathLengthOptimizationObjective(information)
    objective.setCostThreshold(base.Cost(float("inf")))
    setup.setOptimizationObjective(objective)
    return setup, motions, objective, information, space, states


def _stands(judge: Judge, state: Any) -> bool:
    """Return whether the rover can stand at a state."""
    return not judge.stand(np.array([[state.getX(), state.getY(), state.getYaw()]]))[0]
