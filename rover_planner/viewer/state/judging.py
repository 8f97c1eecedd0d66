# SPDX-License-Identifier: Apache-2.0
"""Judges a scenario step by step: the path, its reference, others, its chance, a path around."""

from collections.abc import Generator, Iterator, Sequence
from dataclasses import replace

from rover_physics.chance.failure_chance import find_failure_chance
from rover_physics.errors import RoverError
from rover_physics.limits.table import CHANCE as CHANCE_CODE
from rover_physics.names import TORQUE_POLICIES
from rover_physics.numerics.arrays import Floats
from rover_physics.prediction.packed_model import pack_model
from rover_physics.prediction.sweep import predict_paths
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.traversability.verdict import hold_against_limits
from rover_planner.planning.path_query import choose, generate_paths
from rover_planner.planning.search.edge_memory import EdgeMemory
from rover_planner.planning.search.judge import PathJudge
from rover_planner.planning.search.path_search import SearchResult, find_path
from rover_planner.planning.search.query import SearchQuery
from rover_planner.viewer.state.background_work import WorkStep
from rover_planner.viewer.state.scenario import JudgedPath, Scenario, Shown

PATH, COMPARE, POLICY, CHANCE = "path", "reference", "policy", "chance of failure"
SEARCH, BETTER = "searching for a path", "path found, searching for a better one"
"""Names of steps."""
Step = WorkStep | Shown
"""The beginning of a step, or what is known."""


def judge_steps(
    asked: Scenario,
    before: Shown | None = None,
    index: int | None = None,
    reference: Scenario | None = None,
    memory: EdgeMemory | None = None,
) -> Iterator[Step]:
    """Yield what is shown with the verdict on the path looked at, then with more and more.

    Its reference, the other paths, its verdicts under all policies and its chance of failure
    follow. If all candidates are refused, so do the first path around obstacles and the best of
    the search's budget, or why there is none. The path that is looked at stays the same.

    Args:
        asked: Rover, ground, ends and options.
        before: What was shown, whose paths are judged again; None: other paths are wanted.
        index: Index of the path that is looked at; None: the one that is chosen.
        reference: Values to compare with; None: the rover as it was loaded.
        memory: What earlier searches have found; None begins anew.

    Raises:
        RoverError, PlanningError: The rover, the poses or the options are invalid.
    """
    if before is None or index is None:
        shown = yield from _judge_new(asked)
    else:
        shown = yield from _judge_again(asked, before, index)
    values = asked.take_values(reference or asked.as_loaded())
    shown = replace(shown, reference=_recall(shown, before, values))
    yield shown
    if shown.reference is None and not shown.path.is_of(shown.path.poses, values):
        yield WorkStep(COMPARE)
        shown = replace(shown, reference=_judge(values, shown.path.poses))
        yield shown
    if shown.old:
        paths = list(shown.paths)
        for k in sorted(shown.old):
            yield WorkStep(PATH, k + 1, len(paths))
            paths[k] = _judge(asked, paths[k].poses)
        shown = replace(shown, paths=tuple(paths))
        yield shown
    if asked.recorded is not None:
        return
    shown = yield from _add_policies(shown)
    yield shown
    if shown.chance is None:
        yield WorkStep(CHANCE)
        shown = _add_chance(shown)
        yield shown
    on_map = all(asked.terrain.contains(*end[:2]) for end in (asked.start, asked.goal))
    if shown.best is None and shown.around is None and on_map:
        yield from _search_around(shown, memory or EdgeMemory())


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
    path = JudgedPath(prediction.poses, prediction, verdict, scenario)
    return Shown(scenario, (path,), 0, 1)


def _judge_new(asked: Scenario) -> Generator[Step, None, Shown]:
    """Judge all candidate paths, or the recorded path, and look at the one that is chosen."""
    if asked.recorded is None:
        paths = generate_paths(asked.rover, asked.start, asked.goal, asked.candidates)
    else:
        paths = [asked.recorded]
    judged = []
    for k, poses in enumerate(paths):
        yield WorkStep(PATH, k + 1, len(paths))
        judged.append(_judge(asked, poses))
    return Shown(asked, tuple(judged), choose(tuple(judged)).choice, len(judged))


def _judge_again(asked: Scenario, before: Shown, index: int) -> Generator[Step, None, Shown]:
    """Judge the path that is looked at; paths that nobody looks at go with their values."""
    same, path, paths = before.scenario is asked, before.paths[index], before.paths
    generated = before.generated
    if not same:
        paths = (*paths[:generated], *(paths[index : index + 1] if index >= generated else ()))
        index = min(index, generated)
    if path.scenario is not asked:
        yield WorkStep(PATH)
        path = _judge(asked, path.poses)
    paths = (*paths[:index], path, *paths[index + 1 :])
    policies = before.by_policy if path.poses is before.path.poses else {}
    around = before.around if same else None
    chance = before.chance if path is before.path else None
    return Shown(asked, paths, index, generated, None, policies, chance, around)


def _recall(shown: Shown, before: Shown | None, values: Scenario) -> JudgedPath | None:
    """Return the path that is looked at as it was judged for other values, if it was."""
    poses = shown.path.poses
    if before is None or shown.path.is_of(poses, values):
        return None
    known = (before.reference, *before.paths)
    return next((one for one in known if one is not None and one.is_of(poses, values)), None)


def _add_policies(shown: Shown) -> Generator[Step, None, Shown]:
    """Return what is shown with the path's verdicts under all policies."""
    asked, own = shown.scenario, shown.verdict
    found = {**shown.by_policy, own.policy: (asked, own)}
    for k, policy in enumerate(TORQUE_POLICIES):
        if policy in found and found[policy][0] is asked:
            continue
        yield WorkStep(POLICY, k + 1, len(TORQUE_POLICIES))
        try:
            values = asked.change_options(policy=policy)
            found[policy] = asked, _judge(values, shown.path.poses).verdict
        except RoverError as error:
            found[policy] = asked, str(error)
    return replace(shown, by_policy=found)


def _add_chance(shown: Shown) -> Shown:
    """Return what is shown with the chance that the path fails, up to where it is refused.

    Beyond, a path that fails for sure takes minutes on rough ground, and tells nothing.
    """
    asked, verdict, poses = shown.scenario, shown.verdict, shown.path.poses
    if not verdict.traversable and verdict.code != CHANCE_CODE:
        poses = poses[: verdict.first_failure + 1]
    model = pack_model(asked.rover, asked.terrain, asked.options.model)
    (swept,) = predict_paths(model, [poses], False)
    return replace(shown, chance=find_failure_chance(model, swept))


def _search_around(shown: Shown, memory: EdgeMemory) -> Iterator[Step]:
    """Yield what is shown with the first path around obstacles, and with a better one if there is.

    Without one, what is shown has the reason.
    """
    yield WorkStep(SEARCH)
    asked = shown.scenario
    question = SearchQuery(asked.site, asked.start, asked.goal)
    first = find_path(question, replace(asked.search, ends_at_first=True), memory)
    yield _add_path(shown, first)
    left = asked.search.budget - first.seconds
    if first.path is None or left <= 0.0:
        return
    yield WorkStep(BETTER)
    better = find_path(question, replace(asked.search, budget=left), memory)
    if better.cost < first.cost:
        yield _add_path(shown, better)


def _add_path(shown: Shown, around: SearchResult) -> Shown:
    """Return what is shown with a path around as one more, which nobody looks at yet."""
    paths = shown.paths
    if around.path is not None:
        paths = (*paths, JudgedPath(**vars(around.path), scenario=shown.scenario))
    return replace(shown, paths=paths, around=around)


def _judge(scenario: Scenario, poses: Floats) -> JudgedPath:
    """Judge a path up to its first failure, where its playback ends."""
    candidate = PathJudge(scenario.site).check(poses, stop_at_failure=True)
    return JudgedPath(**vars(candidate), scenario=scenario)
