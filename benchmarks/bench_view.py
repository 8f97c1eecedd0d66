"""Times the page: from a moved slider to the new verdict, for paths of 10 m on several grounds."""

import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from benchmarks.grounds import made_reef, real_maps
from benchmarks.measure import Figure, quantile
from rover_physics.prediction.map_sweep import score_poses
from rover_physics.rover.model import Rover
from rover_physics.rover.rover_contents import rover_to_dict
from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.grid import Terrain
from rover_planner.planning.ways.way_search import LatticeSettings
from rover_planner.studies.rover_values import RoverValue, get_value, list_values
from rover_planner.viewer.pages.page import Page
from rover_planner.viewer.state.scenario import Pose
from rover_planner.viewer.state.session import ViewSession
from support.grounds import make_terrain, waves
from support.viewer.sessions import tolerant_rover

LENGTH = 10.0
"""Distance between start and goal [m], or the longest that fits on the map."""
PATHS = 3
"""Paths on each ground."""
SLIDERS = {"friction [-]": (0.6, 0.9), "radius [m]": (1.02, 0.98)}
"""Sliders, and the values they get in turns, relative to the first one."""
PLACES = 3000
"""Random poses of which those where the rover stands become ends of paths."""
BRIEFLY = LatticeSettings(budget=0.1)
"""How a way around is searched where all paths are refused; it is not what is timed."""
POLL = 5e-4
"""Time between two looks at the page [s]."""
TARGETS = {"otira_tls_boulders_3cm": 200.0, "made reef": 2000.0}
"""Longest time to a new verdict [ms]; elsewhere 200 ms."""


class TimedPage(Page):
    """A page that notes when it draws."""

    def __init__(self, session: ViewSession):
        self.drawn: list[float] = []
        super().__init__(session, port=0)

    @property
    def processor_time(self) -> float:
        """Processor time that the page's own thread has used [s]."""
        assert self._thread.ident is not None
        return time.clock_gettime(time.pthread_getcpuclockid(self._thread.ident))

    def advance(self, seconds: float) -> None:
        """Draw the next picture."""
        self.drawn.append(time.perf_counter())
        super().advance(seconds)


@dataclass
class Times:
    """What was measured on one ground."""

    verdicts: list[float] = field(default_factory=list)
    """Times from a slider to the new verdict, in words [s]."""
    drawings: list[float] = field(default_factory=list)
    """Times to all drawings of that verdict: paths, failure, lanes, plots, tables [s]."""
    efforts: list[float] = field(default_factory=list)
    """Processor times of the page's own thread up to there [s]; other load hardly counts."""
    rests: list[float] = field(default_factory=list)
    """Times to the verdicts under all policies [s]."""
    pauses: list[float] = field(default_factory=list)
    """Longest times between two pictures while it was judged [s]."""


def measure() -> list[Figure]:
    """Measure the page on all grounds, with the preset and with a rover that fails late."""
    found = [measure_ground(name, ground) for name, ground in grounds().items()]
    return [figure for figures in found for figure in figures]


def grounds() -> dict[str, Terrain]:
    """Return the grounds by name."""
    maps = {name: ground.fill_gaps(0.2) for name, ground in real_maps().items()}
    return {
        "waves": make_terrain(waves, half=6.0),
        **maps,
        "made reef": made_reef(half=5.5),
    }


def measure_ground(name: str, ground: Terrain) -> Iterator[Figure]:
    """Measure one ground."""
    lsr1 = load_rover("lsr1")
    pairs = choose_pairs(lsr1, ground)
    length = float(np.median([np.hypot(*np.subtract(b[:2], a[:2])) for a, b in pairs]))
    for rover, kind in ((lsr1, "LSR-1"), (tolerant_rover(), "a rover that hardly fails")):
        times = Times()
        for start, goal in pairs:
            session = ViewSession(rover, ground, start, goal, search=BRIEFLY)
            time_page(session, times, whole=rover is lsr1)
        title = f"{name}, {length:.1f} m, {kind}"
        target, repeats = TARGETS.get(name, 200.0), len(times.verdicts)
        figure = partial(Figure, "view", unit="ms", repeats=repeats)
        yield figure(f"{title}: slider to verdict", value=1e3 * quantile(times.verdicts, 0.5),
                     target=target)  # fmt: skip
        yield figure(f"{title}: the longest", value=1e3 * max(times.verdicts), target=target)
        drawings = times.drawings
        yield figure(f"{title}: slider to drawings", value=1e3 * quantile(drawings, 0.5))
        yield figure(f"{title}: the longest to drawings", value=1e3 * max(drawings), target=target)
        efforts = times.efforts
        yield figure(f"{title}: page's processor time", value=1e3 * quantile(efforts, 0.5))
        yield figure(f"{title}: page's longest processor time", value=1e3 * max(efforts))
        if times.rests:
            yield figure(
                f"{title}: slider to all policies", value=1e3 * quantile(times.rests, 0.5)
            )
            yield figure(f"{title}: the longest to all", value=1e3 * max(times.rests))
        yield figure(f"{title}: longest pause of the pictures", value=1e3 * max(times.pauses))


def choose_pairs(rover: Rover, ground: Terrain) -> list[tuple[Pose, Pose]]:
    """Return PATHS starts and goals, LENGTH apart where that fits, at which the rover stands."""
    rng = np.random.default_rng(1)
    xmin, xmax, ymin, ymax = ground.bounds
    poses = rng.uniform((xmin, ymin, -np.pi), (xmax, ymax, np.pi), (PLACES, 3))
    stands = score_poses(rover, ground, poses).within_limits(rover)
    places = poses[stands if stands.sum() > PATHS else np.isfinite(poses[:, 0])][:600, :2]
    apart = np.linalg.norm(places[:, None] - places[None], axis=2)
    order = np.argsort(np.abs(apart - LENGTH), axis=None)[:400]
    pairs = []
    for at in rng.choice(order, PATHS, replace=False):
        first, last = places[at // len(places)], places[at % len(places)]
        yaw = float(np.arctan2(*(last - first)[::-1]))
        pairs.append(((*map(float, first), yaw), (*map(float, last), yaw)))
    return pairs


def time_page(session: ViewSession, times: Times, whole: bool) -> None:
    """Move sliders of a page on which the rover drives; wait for the verdict or for all."""
    page = TimedPage(session)
    try:
        _wait(lambda: not page.is_busy)
        values = [v for part in list_values(session.rover).values() for v in part]
        data = rover_to_dict(session.rover)
        for label, shares in SLIDERS.items():
            (value,) = (v for v in values if v.label == label)
            for share in shares:
                page.requests.add(page.playback.play)
                number = share * get_value(data, value.keys[0])
                _time_change(page, value, number, times, whole)
    finally:
        page.close()


def _time_change(
    page: TimedPage, value: RoverValue, number: float, times: Times, whole: bool
) -> None:
    session, before, began = page.session, page.session.wanted, time.perf_counter()
    effort = page.processor_time
    page.requests.add(lambda: page._change_value(value, number), "slider")
    _wait(lambda: session.wanted is not before)
    _wait(lambda: not session.is_outdated)
    _wait_for_page(page)
    times.verdicts.append(time.perf_counter() - began)
    _wait(lambda: not page.is_drawing)
    times.drawings.append(time.perf_counter() - began)
    times.efforts.append(page.processor_time - effort)
    if whole:
        _wait(lambda: not page.is_busy)
        _wait_for_page(page)
        times.rests.append(time.perf_counter() - began)
    else:
        page.requests.add(page._cancel)
    _wait(lambda: page._changed_at is None and not page.is_busy)  # all candidates, too
    ended = time.perf_counter()
    drawn = [began, *(t for t in list(page.drawn) if began < t < ended), ended]
    times.pauses.append(float(np.diff(drawn).max()))


def _wait_for_page(page: Page) -> None:
    """Wait until the page's thread has done what was requested before."""
    shown = threading.Event()
    page.requests.add(shown.set)
    shown.wait()


def _wait(condition: Callable[[], bool]) -> None:
    while not condition():
        time.sleep(POLL)
