"""Two clients ask at the same time; each tells its own verdicts from the other's."""

import itertools
import random
import time
from dataclasses import dataclass, field
from typing import Any

from benchmarks.server_trials.stage import Client, Pose, Stage, plan_request, straight_path
from msg_adapters.identity import path_hash, plan_request_hash
from support.grounds import make_terrain, wall_at
from support.waiting import wait_until

WALL = 1.5
"""x of a wall that no rover climbs [m]."""
MAX_PAUSE = 0.01
"""Longest time between a path and its check [s]."""


@dataclass(frozen=True)
class Errand:
    """The questions of one client: all end before the wall, or all beyond it."""

    name: str
    passable: bool

    def poses(self, number: int) -> tuple[Pose, Pose]:
        """Return start and goal of a question; no two questions have the same."""
        end = (0.0 if self.passable else 2.5) + 1e-4 * number
        return (-1.5, 0.0, 0.0), (end, 0.0, 0.0)


ERRANDS = (Errand("before_the_wall", True), Errand("beyond_the_wall", False))


@dataclass
class Tally:
    """What one client has seen."""

    mix_ups: list[str] = field(default_factory=list)
    """Verdicts that a client took for its own, but which were on another question."""
    accepted: int = 0
    """Verdicts that a client took for its own."""
    told_apart: int = 0
    """Verdicts that a client knew to be another's."""

    def take(self, errand: Errand, number: int, verdict: dict[str, Any]) -> None:
        """Compare a verdict that a client took for its own with what its own must be."""
        start, goal = errand.poses(number)
        self.accepted += 1
        right = verdict["traversable"] == errand.passable
        if not right or abs(float(verdict["length"]) - (goal[0] - start[0])) > 2e-5:
            self.mix_ups.append(f"{errand} {number}: {verdict}")


def start_server(stage: Stage, is_paused: bool) -> list[Client]:
    """Start a server, on a simulated time that stands still or not; return two clients."""
    ground = make_terrain(wall_at(WALL))
    few = {"candidate_count": 1, "waypoint_spacing": 0.05}
    stage.start_ready(ground, use_sim_time=is_paused, time_budget=60.0, **few)
    return [stage.client(errand.name) for errand in ERRANDS]


def check_paths(client: Client, errand: Errand, count: int) -> Tally:
    """Check paths one after another, each until the verdict is on it.

    The client waits a random time between path and check, in which the other's path may come.
    """
    tally, chance = Tally(), random.Random(errand.name)
    for number in range(count):
        path = straight_path(*errand.poses(number))
        own, request = path_hash(path), 0
        for _ in itertools.count():
            client.publish(path)
            time.sleep(chance.uniform(0.0, MAX_PAUSE))
            verdict = client.check()
            assert verdict["request"] > request, "the numbers of questions rise"
            request = verdict["request"]
            if verdict["path_hash"] == own:
                tally.take(errand, number, verdict)
                break
            tally.told_apart += 1
    return tally


def plan_paths(client: Client, errand: Errand, count: int) -> Tally:
    """Ask for plans one after another, each with its verdict."""
    tally = Tally()
    client.hear_verdicts()
    for number in range(count):
        poses = errand.poses(number)
        request = plan_request(*poses)
        own = plan_request_hash(request.start, request.goal, request.tolerance)
        stamp = client.plan(*poses).header.stamp

        def find(own: str = own, stamp: Any = stamp) -> dict[str, Any] | None:
            heard = list(client.verdicts)
            for message in heard:
                told = {entry.key: entry.value for entry in message.status[0].values}
                if (told["question_hash"], message.header.stamp) == (own, stamp):
                    del client.verdicts[: len(heard)]
                    tally.told_apart += len(heard) - 1
                    return told
            return None

        verdict = wait_until(find, f"the verdict on question {number}")
        tally.take(errand, number, verdict | {"traversable": verdict["traversable"] == "true"})
    return tally
