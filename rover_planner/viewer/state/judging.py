# SPDX-License-Identifier: Apache-2.0
"""Judges a scenario step by step: the shown path or all candidates, policies, a path around."""

import time
from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass, replace

from rover_physics.errors import RoverError
from rover_physics.names import TORQUE_POLICIES
from rover_physics.numerics.arrays import Floats
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.traversability.verdict import hold_against_limits
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
from rover_planner.viewer.state.background_work import Progress
from rover_planner.viewer.state.scenario import PolicyVerdict, Scenario, Shown
from rover_planner.viewer.state.trajectory import Trajectory

PATH, POLICY, SEARCH = "judging path", "judging policy", "searching a way"
BETTER = "way found, searching a better one"
"""Names of steps."""


@dataclass(frozen=True, eq=False)
class JudgeRequest:
    """A scenario to judge, or one path of it."""

    scenario: Scenario
    """Rover, ground, ends and options."""
    before: Shown | None = None
    """The last finding, of which a candidate is judged again; None: all candidates are judged."""
    index: int = 0
    """Index of that candidate."""


Step = Progress | Shown
"""The beginning of a step, or what is known."""


def judge_request(request: JudgeRequest, memory: EdgeMemory | None = None) -> Iterator[Step]:
    """Yield what is shown with the verdict, then the same with those of all policies.

    If all candidates are refused, it follows with the first path around obstacles and with the
    best of the search's budget, or with why there is none. Before each path, each policy and the
    search it yields that it begins.

    Args:
        request: What to judge.
        memory: What earlier searches have found; None begins anew.

    Raises:
        RoverError, PlanningError: The rover, the poses or the options are invalid.
    """
    judge = _judge_all(request.scenario) if request.before is None else _judge_one(request)
    judged = yield from judge
    yield judged
    if judged.scenario.recorded is not None:
        return
    judged = yield from _add_policies(judged)
    if judged.needs_search:
        yield from _search_around(judged, memory or EdgeMemory())


def show_recorded(scenario: Scenario, prediction: PathPrediction, reasons: Sequence[str]) -> Shown:
    """Return a recorded prediction with the recorded reasons (n,) of its waypoints."""
    first = next((k for k, reason in enumerate(reasons) if reason), -1)
    driven = prediction if first < 0 else prediction.cut(first + 1)
    verdict = replace(
        hold_against_limits(scenario.rover, driven),
        traversable=first < 0,
        reasons=tuple(reasons),
        first_failure=first,
        reason=reasons[first] if first >= 0 else "",
    )
    candidate = Candidate(prediction.poses, prediction, verdict, (0.0, 0.0))
    answer = PathAnswer((candidate,), 0 if first < 0 else -1, 0)
    return _show(scenario, answer, 0, "recorded")


def _judge_all(scenario: Scenario) -> Generator[Step, None, Shown]:
    """Judge all candidate paths, or the recorded path, and show the one that is chosen."""
    began = time.perf_counter()
    if scenario.recorded is None:
        ends = scenario.start, scenario.goal
        paths = generate_paths(scenario.rover, *ends, scenario.options)
    else:
        paths = [scenario.recorded]
    candidates = []
    for k, path in enumerate(paths):
        yield Progress(PATH, k + 1, len(paths))
        candidates.append(_check(scenario, path))
    answer = choose(tuple(candidates))
    passable = sum(candidate.verdict.traversable for candidate in candidates)
    words = f"{passable} of {len(paths)} candidate paths passable, judged in"
    if scenario.recorded is not None:
        words = "recorded path judged again in"
    return _show(scenario, answer, answer.nearest, f"{words} {_milliseconds(began)}")


def _judge_one(request: JudgeRequest) -> Generator[Step, None, Shown]:
    """Show a candidate of what was shown, judged again unless its verdict still holds."""
    began, scenario = time.perf_counter(), request.scenario
    before, index = request.before, request.index
    assert before is not None
    candidate, summary = before.answer.candidates[index], before.summary
    if before.answered is not scenario:
        yield Progress(PATH, 1, 1)
        candidate = _check(scenario, candidate.poses)
        summary = f"path of {candidate.length:.1f} m judged again in {_milliseconds(began)}"
    old = before.by_policy if index == before.index else ()
    shown = _show(scenario, before.answer, index, summary, candidate, old)
    return replace(shown, answered=before.answered, around=before.around)


def _show(
    scenario: Scenario,
    answer: PathAnswer,
    index: int,
    summary: str,
    candidate: Candidate | None = None,
    old: tuple[PolicyVerdict, ...] = (),
) -> Shown:
    """Return a candidate of an answer as what is shown.

    Args:
        scenario: What it was judged for.
        answer: All candidates.
        index: Its index.
        summary: What was judged.
        candidate: The candidate as it was judged again (default: as in the answer).
        old: Its verdicts under other policies, which are of other values.
    """
    candidate = candidate or answer.candidates[index]
    trajectory = Trajectory(scenario.rover, candidate.prediction, candidate.verdict)
    by_policy: tuple[PolicyVerdict, ...] = ()
    if scenario.recorded is None:
        known = {policy: PolicyVerdict(policy, None, "") for policy in TORQUE_POLICIES}
        known |= {one.policy: one for one in old}
        known = {policy: replace(one, is_old=True) for policy, one in known.items()}
        by_policy = tuple((known | {candidate.verdict.policy: _own_verdict(candidate)}).values())
    return Shown(scenario, answer, scenario, index, candidate, trajectory, summary, by_policy)


def _own_verdict(candidate: Candidate) -> PolicyVerdict:
    verdict = candidate.verdict
    return PolicyVerdict(verdict.policy, verdict.traversable, verdict.reason)


def _add_policies(shown: Shown) -> Generator[Step, None, Shown]:
    """Yield, and return, what is shown with the path's verdicts under all policies."""
    found = []
    for k, policy in enumerate(TORQUE_POLICIES):
        yield Progress(POLICY, k + 1, len(TORQUE_POLICIES))
        found.append(_judge_under(policy, shown.scenario, shown.candidate))
    shown = replace(shown, by_policy=tuple(found))
    yield shown
    return shown


def _search_around(shown: Shown, memory: EdgeMemory) -> Iterator[Step]:
    """Yield what is shown with the first path around obstacles, and with a better one if there is.

    Without one, what is shown has the reason.
    """
    yield Progress(SEARCH, 1, 1)
    asked = shown.scenario
    ends = asked.start, asked.goal
    question = SearchQuery(asked.rover, asked.terrain, *ends, asked.asked_options)
    first = find_path(question, replace(asked.search, ends_at_first=True), memory)
    yield from _add_found_path(shown, first)
    left = asked.search.budget - first.seconds
    if first.path is None or left <= 0.0:
        return
    yield Progress(BETTER, 1, 1)
    better = find_path(question, replace(asked.search, budget=left), memory)
    if better.cost < first.cost:
        seconds = first.seconds + better.seconds
        yield from _add_found_path(shown, replace(better, seconds=seconds))


def _add_found_path(shown: Shown, around: SearchResult) -> Iterator[Step]:
    """Yield what is shown with a path as one more candidate, or with why there is none.

    The path is shown unless a visitor has chosen another path than the best.
    """
    answer, path = shown.answer, around.path
    if path is None:
        yield replace(shown, around=around)
        return
    candidates = (*answer.candidates, path)
    last = len(candidates) - 1
    longer = PathAnswer(candidates, last, last)
    if shown.index != answer.nearest:
        yield replace(shown, answer=longer, around=around)
        return
    found = f"way of {path.length:.1f} m around, found in {around.seconds:.1f} s"
    summary = f"none of {last} candidate paths passable; {found}"
    with_path = replace(_show(shown.scenario, longer, last, summary), around=around)
    yield with_path
    yield from _add_policies(with_path)


def _judge_under(policy: str, scenario: Scenario, candidate: Candidate) -> PolicyVerdict:
    """Return the verdict on a judged path under a policy, up to the first failure."""
    if candidate.verdict.policy == policy:
        return _own_verdict(candidate)
    try:
        options = scenario.options.change(policy=policy)
        return _own_verdict(_check(replace(scenario, options=options), candidate.poses))
    except RoverError as error:
        return PolicyVerdict(policy, None, str(error))


def _check(scenario: Scenario, poses: Floats) -> Candidate:
    """Judge a path up to its first failure, where its playback ends."""
    rover, terrain, options = scenario.rover, scenario.terrain, scenario.asked_options
    return check_path(rover, terrain, poses, options, stop_at_failure=True)


def _milliseconds(began: float) -> str:
    """Return the time since `began` as text."""
    return f"{1e3 * (time.perf_counter() - began):.0f} ms"
