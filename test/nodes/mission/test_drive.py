# SPDX-License-Identifier: Apache-2.0
"""A drive goes on where its rover is held up, and ends where nothing helps."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from rover_planner.errors import DriveFailedError
from rover_planner.nodes.mission import drive
from rover_planner.nodes.mission.client import Answer
from rover_planner.nodes.mission.drive import Drive, DriveSettings
from rover_planner.planning.marked_places import NONE_MARKED, MarkedPlace, MarkedPlaces
from rover_planner.planning.path_query import PathQueryOptions
from rover_planner.planning.search.judge import PathJudge
from rover_planner.planning.search.query import Site
from rover_planner.simulator.path_follower import PathFollower
from rover_planner.simulator.quasi_static_plant import QuasiStaticPlant
from support.grounds import make_terrain, plane
from support.rovers import LSR1

MAP = plane(0.0, 0.0, half=4.0)
STEP = 0.1
JUDGE = PathJudge(Site(LSR1, MAP, PathQueryOptions(count=1, waypoint_spacing=0.05)))
SETTINGS = DriveSettings(position_tolerance=0.1, patience=0.3)


class SimulatedRover:
    """A rover on a ground that its map does not show; time runs as fast as it is computed."""

    def __init__(self, ground):
        self.plant = QuasiStaticPlant(LSR1, ground, (-1.0, 0.0, 0.0))
        self.follower = PathFollower(self.plant.pose()[None], 0.3)
        self.asked, self.now, self.speaks = [], 0.0, True
        self.make_follower, self.marked = PathFollower, NONE_MARKED

    def ask(self, start, goal):
        self.asked.append(np.array(start))
        answer = JUDGE.search(start, goal)
        poses = answer.chosen.poses if answer.traversable else []
        return Answer(answer.traversable, True, "", answer.explain(), poses, {})

    def send_path(self, poses):
        self.follower = self.make_follower(poses, 0.3)

    def check(self, poses):
        verdict = PathJudge(replace(JUDGE.site, marked=self.marked)).check(poses).verdict
        return Answer(verdict.traversable, True, verdict.code, verdict.reason, poses, {})

    def has_ended(self):
        return self.follower.has_arrived(self.plant.pose()) if self.speaks else None

    def wait_for_pose(self, is_wanted, seconds):
        for _ in range(round(seconds / STEP)):
            if is_wanted(self.plant.pose()):
                break
            self.plant.drive(*self.follower.steer(self.plant.pose(), 0.1), STEP)
            self.now += STEP
        return self.plant.pose()


@pytest.fixture
def make_rover(monkeypatch):
    """Return a function that makes a rover whose time is that of the drive."""

    def make(ground):
        rover = SimulatedRover(ground)
        monkeypatch.setattr(drive, "time", SimpleNamespace(monotonic=lambda: rover.now))
        return rover

    return make


def test_a_rover_before_a_place_that_is_marked_goes_back_before_it_asks_again(make_rover):
    rover = make_rover(MAP)
    goal, told = (1.5, 0.0, 0.0), []
    plan = rover.ask(rover.plant.pose(), goal).poses

    def ask_freed(start, goal, ask=rover.ask):
        rover.marked = NONE_MARKED
        return ask(start, goal)

    rover.ask = ask_freed
    rover.marked = MarkedPlaces((MarkedPlace(0.4, 0.0, 0.4, "stuck", "today"),))
    Drive(rover, goal, SETTINGS, told.append).run(plan)
    assert "stuck" in told[0] and "back to" in told[1]
    assert rover.plant.pose()[0] == pytest.approx(1.5, abs=0.15)


def test_a_rover_at_a_hill_that_no_map_shows_goes_back_and_gives_up_at_last(make_rover):
    rover = make_rover(make_terrain(lambda x, y: 0.9 * np.maximum(x, 0.0)))
    goal, told = (1.5, 0.0, 0.0), []
    plan = rover.ask(rover.plant.pose(), goal).poses
    hindrance = "3 other paths led nowhere from .* stood for 0.3 s"
    with pytest.raises(DriveFailedError, match=hindrance):
        Drive(rover, goal, SETTINGS, told.append).run(plan)
    first, again = rover.asked[1], rover.asked[2]
    assert first[0] - again[0] == pytest.approx(0.4, abs=0.15)  # back along the plan
    assert sum("has stood" in what for what in told) == 4
    assert sum("back to" in what for what in told) == 2


def test_the_next_plan_begins_where_the_rover_has_come_to_rest(make_rover):
    rover = make_rover(MAP)
    half_way = (0.0, 0.0, 0.0)
    plan = rover.ask(rover.plant.pose(), half_way).poses
    resting = []
    tell = lambda what: resting.append(rover.plant.pose())  # noqa: E731
    Drive(rover, (1.5, 0.0, 0.0), SETTINGS, tell).run(plan)
    assert len(resting) == 1
    assert resting[0] == pytest.approx(rover.asked[1])
    assert rover.plant.pose()[0] == pytest.approx(1.5, abs=0.15)


@pytest.mark.parametrize("speaks", [True, False])
def test_a_rover_that_ends_beside_the_goal_or_turned_away_has_not_arrived(make_rover, speaks):
    """It was told to have arrived 0.18 m and 33 degrees off, after it had been stopped."""
    rover = make_rover(MAP)
    rover.speaks = speaks
    goal, told = (0.5, 0.0, 0.0), []
    plan = rover.ask(rover.plant.pose(), goal).poses

    class Short(PathFollower):
        """Ends its first path too early, and turned."""

        def has_arrived(self, pose):
            return super().has_arrived(pose) or (not told and pose[0] > 0.32)

        def steer(self, pose, speed):
            return (0.0, 0.0) if self.has_arrived(pose) else super().steer(pose, speed)

    rover.make_follower = Short
    end = Drive(rover, goal, SETTINGS, told.append).run(plan)
    assert any("has ended 0.1" in what or "has stood" in what for what in told), told
    assert rover.plant.pose() == pytest.approx(goal, abs=0.1)
    assert end == pytest.approx(rover.plant.pose())
