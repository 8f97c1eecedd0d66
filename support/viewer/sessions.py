# SPDX-License-Identifier: Apache-2.0
"""Paths, grounds and sessions for tests of the viewer."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

import numpy as np

from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_planner.planning.path_query import PathQueryOptions
from rover_planner.planning.search.query import LatticeSettings
from rover_planner.viewer.state.background_work import BackgroundWork, Inbox, WorkStep
from rover_planner.viewer.state.judging import Step
from rover_planner.viewer.state.scenario import Pose, Scenario, Shown
from rover_planner.viewer.state.session import REFUSALS, ViewSession
from support.grounds import make_terrain, waves
from support.paths import poses_at
from support.rovers import LSR1
from support.waiting import wait_until

STRAIGHT = poses_at(np.linspace(-1.0, 1.0, 101))
"""Poses along x."""
FAR = (500_000.0, 4_000_000.0)
"""Place of a map in a UTM zone: easting and northing [m]."""
SURE = PathQueryOptions(count=5, spacing=0.5, waypoint_spacing=0.05, accepted_chance=1.0)
"""Options of a session with waypoints far apart and no chances of failure, which take most of the
time of a verdict."""
PATIENCE = 120.0
"""Longest wait for a page [s]; drawing and judging take seconds on a busy machine."""


def ramp(x, y):
    """Return waves with a slope of 1 in 4 along x: passable with mu 0.8, only partly with 0.4."""
    return waves(x, y) + 0.25 * x


def session_on(
    ground: Any,
    start: Pose = (-2.0, 0.0, 0.0),
    goal: Pose = (1.0, 0.0, 0.0),
    options: PathQueryOptions = SURE,
    rover: Rover = LSR1,
    **more: Any,
) -> ViewSession:
    """Return a session on a terrain, or on a ground with heights ground(x, y) [m].

    It judges at once, until a page or a `Judge` takes that over.
    """
    terrain = ground if isinstance(ground, Terrain) else make_terrain(ground)
    session = ViewSession(Scenario(rover, rover, terrain, start, goal, options, **more))

    def judge(steps: Iterator[Step]) -> None:
        try:
            for found in steps:
                if isinstance(found, Shown):
                    session.take(steps, found)
        except REFUSALS as error:
            session.take(steps, error)

    session.judge = judge
    return session


def blocked(x, y):
    """Return waves with a block on the straight path and, from x = 2.6 m on, a wall along y."""
    block, wall = (abs(x - 0.5) < 0.2) & (abs(y) < 0.15), (x > 2.6) & (x < 2.8)
    return waves(x, y) + 0.25 * block + 0.5 * wall


def blocked_session() -> ViewSession:
    """Return a session of which some paths are refused and some pass; it searches briefly."""
    search = LatticeSettings(budget=0.5)
    return session_on(blocked, goal=(2.0, 0.0, 0.0), search=search)


def ask(page: Any, action: Callable[[], Any]) -> None:
    """Let the page's own thread act, and wait until it has told what that has changed."""
    for one in (action, lambda: None):  # it tells before it takes what comes next
        done = threading.Event()
        for request in (one, done.set):
            page.requests.put(request)
        assert done.wait(PATIENCE), "the page's thread does nothing"


class Judge:
    """Judges for a session in a thread, as a page does, until the end of the context."""

    def __init__(self, session: ViewSession):
        """Let a session judge in the background; nothing is judged yet."""
        self.session, self._found = session, Inbox[Any]()
        self.work = BackgroundWork[Any](lambda *found: self._found.put(found))
        session.judge = self.work.ask

    def __enter__(self) -> "Judge":
        return self

    def __exit__(self, *_error: object) -> None:
        assert self.work.close()

    def take(self) -> None:
        """Let the session take what was found."""
        for steps, found in self._found.take().values():
            self.session.take(steps, found)

    def finish(self) -> None:
        """Wait until all is judged, and let the session take it."""
        wait_until(lambda: self.work.progress is None, "the end of the work", 60.0)
        self.take()


wait_patiently = partial(wait_until, timeout=PATIENCE)
"""Returns the first true value of what a busy machine's page does late."""


def wait_for_rest(page: Any) -> None:
    """Wait until everything that is wanted is judged, painted, advised and shown."""
    told = page.session

    def is_at_rest() -> bool:
        if not any(work.progress for work in page.works):
            ask(page, lambda: None)
        is_done = told.is_complete or told.refusal
        return bool(is_done) and not any(work.progress for work in page.works)

    wait_patiently(is_at_rest, "all of it")


@contextmanager
def held(session: ViewSession, at: str = "") -> Iterator[None]:
    """Hold the judgements that a session asks for in the context where they begin with something.

    This is `at`, such as "searching for a path"; empty: anything. What is held can be cancelled,
    and gives way to newer steps, which are held, too. It goes on at the end of the context. So a
    test can look at work that is under way as long as it takes.
    """
    find_steps, go_on = session.find_steps, threading.Event()

    def find_and_wait(*asked: Any) -> Iterator[Step]:
        for found in find_steps(*asked):
            yield found
            is_held = isinstance(found, WorkStep) and at in ("", found.what)
            while is_held and not go_on.wait(0.01):
                yield found  # which ends work that was stopped

    session.find_steps = find_and_wait
    try:
        yield
    finally:
        go_on.set()
        session.find_steps = find_steps
