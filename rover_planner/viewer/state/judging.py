# SPDX-License-Identifier: Apache-2.0
"""Judges a scenario step by step: the shown path or all candidates, policies, a way around."""

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

from rover_physics.errors import RoverError
from rover_physics.names import TORQUE_POLICIES
from rover_physics.numerics.arrays import Floats
from rover_planner.planning.path_query import (
    Candidate,
    PathAnswer,
    check_path,
    choose,
    generate_paths,
)
from rover_planner.planning.search.edge_memory import EdgeMemory
from rover_planner.planning.search.path_search import SearchResult, find_path
from rover_planner.planning.search.query import SearchQuery
from rover_planner.viewer.state.background_work import Report
from rover_planner.viewer.state.comparison import PolicyVerdict
from rover_planner.viewer.state.scenario import Judgement, Scenario, ShownPath
from rover_planner.viewer.state.trajectory import Trajectory

PATH, POLICY, WAY = "judging path", "judging policy", "searching a way"
BETTER = "way found, searching a better one"
"""What is reported to be worked on."""


@dataclass(frozen=True, eq=False)
class JudgeRequest:
    """What to judge."""

    scenario: Scenario
    """Rover, ground, ends and options."""
    before: Judgement | None = None
    """The judgement whose candidate is judged again; None: all candidates are judged."""
    index: int = 0
    """Index of that candidate."""
    searches: bool = True
    """Whether a way around obstacles is searched if all candidates are refused."""


def judge_request(
    request: JudgeRequest, report: Report, memory: EdgeMemory | None = None
) -> Iterator[Judgement]:
    """Yield the judgement with the verdict, then the same with those of all policies.

    If all candidates are refused, it follows with the first way around obstacles and with the best
    of the search's budget, or with why there is none.

    Args:
        request: What to judge.
        report: Called before each path, each policy and the search of a way.
        memory: What earlier searches have found; None begins anew.

    Raises:
        RoverError, PlanningError: The rover, the poses or the options are invalid.
    """
    judged = _judge_one(request, report) if request.before else _judge_all(request, report)
    yield judged
    if judged.scenario.recorded is not None:
        return
    judged = _add_policies(judged, report)
    yield judged
    if request.searches and judged.needs_way:
        for found in _search_ways(judged, report, memory or EdgeMemory()):
            yield found
            if found.shown is not judged.shown:
                yield _add_policies(found, report)


def _judge_all(request: JudgeRequest, report: Report) -> Judgement:
    """Judge all candidate paths, or the recorded path, and show the one that is chosen."""
    began, scenario = time.perf_counter(), request.scenario
    recorded = scenario.recorded is not None
    if scenario.recorded is not None:
        paths = [scenario.recorded]
    else:
        ends = scenario.start, scenario.goal
        paths = generate_paths(scenario.rover, *ends, scenario.options)
    candidates = []
    for k, path in enumerate(paths):
        report(PATH, k + 1, len(paths))
        candidates.append(_check(scenario, path))
    answer = choose(tuple(candidates))
    passable = sum(candidate.verdict.traversable for candidate in candidates)
    words = f"{passable} of {len(paths)} candidate paths passable, judged in"
    if recorded:
        words = "recorded path judged again in"
    shown = _show(scenario, answer.nearest, answer.chosen, f"{words} {_milliseconds(began)}", ())
    return Judgement(scenario, answer, scenario, shown)


def _judge_one(request: JudgeRequest, report: Report) -> Judgement:
    """Show a candidate of the judgement before, judged again unless its verdict still holds."""
    began, scenario = time.perf_counter(), request.scenario
    before, index = request.before, request.index
    assert before is not None
    candidate, summary = before.answer.candidates[index], before.shown.summary
    if before.answered is not scenario:
        report(PATH, 1, 1)
        candidate = _check(scenario, candidate.poses)
        summary = f"path of {candidate.length:.1f} m judged again in {_milliseconds(began)}"
    old = before.shown.by_policy if index == before.shown.index else ()
    shown = _show(scenario, index, candidate, summary, old)
    return replace(before, scenario=scenario, shown=shown)


def _show(
    scenario: Scenario,
    index: int,
    candidate: Candidate,
    summary: str,
    old: tuple[PolicyVerdict, ...],
) -> ShownPath:
    """Return a path with its verdict; those of other policies are old ones, or not known yet."""
    trajectory = Trajectory(scenario.rover, candidate.prediction, candidate.verdict)
    by_policy: tuple[PolicyVerdict, ...] = ()
    if scenario.recorded is None:
        known = {policy: PolicyVerdict(policy, None, "") for policy in TORQUE_POLICIES}
        known |= {one.policy: one for one in old}
        known = {policy: replace(one, is_old=True) for policy, one in known.items()}
        by_policy = tuple((known | {candidate.verdict.policy: _own_verdict(candidate)}).values())
    return ShownPath(index, candidate, trajectory, summary, by_policy)


def _own_verdict(candidate: Candidate) -> PolicyVerdict:
    verdict = candidate.verdict
    return PolicyVerdict(verdict.policy, verdict.traversable, verdict.reason)


def _add_policies(judgement: Judgement, report: Report) -> Judgement:
    """Return a judgement with the shown path's verdicts under all policies."""
    found = []
    for k, policy in enumerate(TORQUE_POLICIES):
        report(POLICY, k + 1, len(TORQUE_POLICIES))
        found.append(_judge_under(policy, judgement.scenario, judgement.shown.candidate))
    return replace(judgement, shown=replace(judgement.shown, by_policy=tuple(found)))


def _search_ways(judgement: Judgement, report: Report, memory: EdgeMemory) -> Iterator[Judgement]:
    """Yield a judgement with the first way around obstacles, and with a better one if there is.

    Without a way, the judgement has the reason.
    """
    report(WAY, 1, 1)
    asked = judgement.scenario
    ends = asked.start, asked.goal
    question = SearchQuery(asked.rover, asked.terrain, *ends, asked.asked_options)
    first = find_path(question, replace(asked.search, ends_at_first=True), memory)
    yield _add_way(judgement, first)
    left = asked.search.budget - first.seconds
    if first.path is None or left <= 0.0:
        return
    report(BETTER, 1, 1)
    better = find_path(question, replace(asked.search, budget=left), memory)
    if better.cost < first.cost:
        seconds = first.seconds + better.seconds
        yield _add_way(judgement, replace(better, seconds=seconds))


def _add_way(judgement: Judgement, way: SearchResult) -> Judgement:
    """Return a judgement of refused candidates with a way as one more, or why there is none.

    The way is shown unless a visitor has chosen another path than the best.
    """
    asked, answer, shown = judgement.scenario, judgement.answer, judgement.shown
    if way.path is None:
        return replace(judgement, way=way)
    candidates = (*answer.candidates, way.path)
    last = len(candidates) - 1
    if shown.index == answer.nearest:
        words = f"way of {way.path.length:.1f} m around, found in {way.seconds:.1f} s"
        summary = f"none of {last} candidate paths passable; {words}"
        shown = _show(asked, last, way.path, summary, ())
    return replace(judgement, answer=PathAnswer(candidates, last, last), shown=shown, way=way)


def _judge_under(policy: str, scenario: Scenario, candidate: Candidate) -> PolicyVerdict:
    """Return the verdict on a judged path under a policy, up to the first failure."""
    if candidate.verdict.policy == policy:
        return _own_verdict(candidate)
    try:
        options = scenario.options.change(policy=policy)
        other = _check(replace(scenario, options=options), candidate.poses)
    except RoverError as error:
        return PolicyVerdict(policy, None, str(error))
    return _own_verdict(other)


def _check(scenario: Scenario, poses: Floats) -> Candidate:
    """Judge a path up to its first failure, where its playback ends."""
    return check_path(
        scenario.rover,
        scenario.terrain,
        poses,
        scenario.asked_options,
        stop_at_failure=True,
    )


def _milliseconds(began: float) -> str:
    """Return the time since `began` as text."""
    return f"{1e3 * (time.perf_counter() - began):.0f} ms"
