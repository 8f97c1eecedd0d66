"""The same questions to servers with other threads, and to one that was started again."""

import hashlib
import json
from collections.abc import Iterator

from builtin_interfaces.msg import Time

from benchmarks.server_trials.stage import Stage
from rover_planner.worlds.mars_terrain import make_mars_terrain
from support.planner_client import PlannerClient, verdict_of

QUESTIONS = (
    ((-2.0, 0.0, 0.0), (2.0, 0.3, 0.0)),
    ((-3.0, 1.0, 0.3), (1.0, -2.0, -1.0)),
    ((0.0, 0.0, 1.0), (-1.0, 2.5, 2.0)),
)
TOLERANCE = 0.3
OWN_KEYS = ("request", "server", "map_age", "path_stamp", "path_hash")
"""Keys of a verdict that name the answer, not the result; the hash of a plan has its stamp."""


def hash_answers(stage: Stage, threads: int, count: int = len(QUESTIONS)) -> str:
    """Start a server with a number of threads; return a hash of its results, to the bit."""
    environment = {"NUMBA_NUM_THREADS": str(threads)}
    ground = make_mars_terrain(1, 12.0, 0.05)
    fixed = {"policy": "optimal", "time_budget": 60.0}
    server = stage.start_ready(ground, environment=environment, **fixed)
    client = stage.ros.spin(PlannerClient(stage.ros))
    digest, passable = hashlib.sha256(), 0
    for poses in QUESTIONS[:count]:
        _, results = client.next_results(
            lambda poses=poses: client.can_traverse(*poses, TOLERANCE)
        )
        passable += bool(results["plan"].poses)
        for part in _write_results(results):
            digest.update(part)
    assert passable, "no question has a path to compare"
    server.stop()
    return digest.hexdigest()


def _write_results(results: dict) -> Iterator[bytes]:
    """Yield the results of an answer as bytes, without what differs between equal answers."""
    verdict = verdict_of(results)
    yield json.dumps({k: v for k, v in verdict.items() if k not in OWN_KEYS}).encode()
    for topic, message in results.items():
        if topic in ("verdict", "markers"):
            continue
        if topic == "plan":
            yield repr([pose.pose for pose in message.poses]).encode()
            continue
        if hasattr(message, "header"):
            message.header.stamp = Time()
        # The text has all digits; a serialised message has bytes between its fields that differ.
        yield repr(message).encode()
