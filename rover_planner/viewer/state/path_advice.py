# SPDX-License-Identifier: Apache-2.0
"""Advice on the path that is looked at, sought in a thread when a visitor asks for it."""

from collections.abc import Callable, Iterator
from dataclasses import replace

from rover_physics.rover.uncertainty import ACCEPTED_CHANCE
from rover_planner.advice.advise import Advice, grow_advice
from rover_planner.advice.case import Case
from rover_planner.advice.remedy import Remedy
from rover_planner.viewer.state.background_work import BackgroundWork
from rover_planner.viewer.state.scenario import Judged, Scenario


class PathAdvice:
    """The advice that was asked for last. All methods belong to the page's thread."""

    def __init__(self, wake: Callable[[], object]):
        """Start the thread; `wake` is called in it when there is something to `take`."""
        self._work = BackgroundWork(_seek, wake, "advice")
        self._about: Judged | None = None
        self._advice: Advice | None = None
        self.failure = ""
        """Why it could not be sought; empty if it could."""

    @property
    def is_busy(self) -> bool:
        """True if levers are tried, or what was found is not taken yet."""
        return self._work.progress is not None or self._work.has_news

    def ask(self, path: Judged) -> None:
        """Seek advice on a path."""
        self._about, self._advice, self.failure = path, None, ""
        self._work.ask(path)

    def take(self) -> None:
        """Take what was found."""
        for one in self._work.take():
            if one.request is self._about:
                self._advice = self._advice if one.result is None else one.result
                self.failure = "" if one.error is None else str(one.error)

    def about(self, path: Judged) -> Advice | None:
        """Return the advice on a path, None if it was not asked or nothing is known yet."""
        return self._advice if path is self._about else None

    def is_asked(self, path: Judged) -> bool:
        """Return whether advice on a path was asked for."""
        return path is self._about

    def stop(self) -> None:
        """Stop to seek."""
        self._work.cancel()

    def close(self) -> None:
        """End the thread."""
        self._work.close()


def apply_remedy(scenario: Scenario, remedy: Remedy) -> Scenario:
    """Return a scenario with the levers of a remedy set, where the page has its own values.

    Friction, torque, payload and limits are numbers of the rover there, which sliders show.
    """
    case, told = remedy.judged.case, remedy.options()
    rover = replace(case.rover, friction=told.get("friction", case.rover.friction))
    most = told.get("max_torque", rover.wheel.max_torque)
    rover = replace(rover, wheel=replace(rover.wheel, max_torque=most))
    if rover.manipulator is not None:
        carried = told.get("payload", rover.manipulator.payload)
        rover = replace(rover, manipulator=replace(rover.manipulator, payload=carried))
    has_path = case.poses is not remedy.refusal.case.poses
    return replace(
        scenario,
        rover=rover,
        arm_angles=told.get("joint_angles", scenario.arm_angles),
        options=scenario.options.change(
            policy=case.options.policy, backward=case.options.backward
        ),
        recorded=case.poses if has_path else scenario.recorded,
    )


def _seek(path: Judged) -> Iterator[Advice]:
    """Yield advice on a path that grows."""
    asked = path.scenario
    options = asked.asked_options
    chance = min(options.accepted_chance, ACCEPTED_CHANCE)
    return grow_advice(
        Case(asked.rover, asked.terrain, path.poses, options.model, options.map_sigmas, chance)
    )
