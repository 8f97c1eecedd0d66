# SPDX-License-Identifier: Apache-2.0
"""Advice on the path that is looked at, and a scenario with a remedy."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

from rover_physics.rover.uncertainty import ACCEPTED_CHANCE
from rover_planner.advice.advise import Advice, grow_advice
from rover_planner.advice.case import Case
from rover_planner.advice.remedy import Remedy
from rover_planner.viewer.state.scenario import Judged, Scenario


@dataclass(frozen=True, eq=False)
class Advised:
    """A path and the advice on it."""

    path: Judged
    """The path."""
    since: float
    """When a visitor asked for advice, on the monotonic clock [s]."""
    advice: Advice | None = None
    """What was found so far; None while the first lever is tried."""


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


def seek_advice(path: Judged) -> Iterator[Advice]:
    """Yield advice on a path that grows."""
    asked = path.scenario
    options = asked.asked_options
    chance = min(options.accepted_chance, ACCEPTED_CHANCE)
    return grow_advice(
        Case(asked.rover, asked.terrain, path.poses, options.model, options.map_sigmas, chance)
    )
