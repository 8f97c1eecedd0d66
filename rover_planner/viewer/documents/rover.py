# SPDX-License-Identifier: Apache-2.0
"""The rover's numbers as sliders, and what of it and of its drive differs from the reference."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from rover_physics.rover.model import Rover
from rover_physics.rover.rover_file import rover_to_dict
from rover_planner.studies.rover_values import RoverValue, get_value, list_values
from rover_planner.viewer.documents.paths import POLICY_TITLES, write_use
from rover_planner.viewer.state.path_limits import write
from rover_planner.viewer.state.scenario import Judged, Scenario

JOINTS = "joints"
"""First key of the angle of a joint, which is no number of the rover file."""
FULL_TURN = 3.15
"""Largest angle, both ways, of the slider of an arm's joint without limits [rad]."""
SAME = 1e-9
"""Difference up to which two numbers are the same."""


def list_sliders(rover: Rover) -> dict[str, list[RoverValue]]:
    """Return the changeable numbers of a rover by part; the last are the angles of its arm."""
    parts, arm = list_values(rover), rover.manipulator
    if arm is not None:
        ends = arm.joint_limits or ((-FULL_TURN, FULL_TURN),) * 3
        parts["Arm"] = [
            RoverValue(((JOINTS, name),), f"{name} [rad]", low, high, 0.01)
            for name, (low, high) in zip(arm.joints, ends, strict=True)
        ]
    return parts


def describe_sliders(scenario: Scenario) -> list[dict[str, Any]]:
    """Return the sliders of the rover as loaded: label, ends, step and its value, by part."""
    loaded = read_values(scenario.as_loaded())
    return [
        {
            "title": title,
            "sliders": [[k.label, k.low, k.high, k.step, loaded[k.label]] for k in values],
        }
        for title, values in list_sliders(scenario.loaded).items()
    ]


def read_values(scenario: Scenario) -> dict[str, float]:
    """Return the numbers of a scenario by the label of their slider."""
    data = {**rover_to_dict(scenario.rover), JOINTS: scenario.arm}
    parts = list_sliders(scenario.loaded).values()
    return {one.label: get_value(data, one.keys[0]) for values in parts for one in values}


def describe_changes(path: Judged, reference: Judged | None, is_kept: bool) -> dict[str, Any]:
    """Return what differs from the reference: numbers of the rover and the arm, and the drive."""
    if reference is None:
        return {"kept": is_kept, "rover": [], "drive": []}
    before, now = read_values(reference.scenario), read_values(path.scenario)
    rows = [
        [label, f"{before[label]:g}", f"{value:g}"]
        for label, value in now.items()
        if abs(value - before[label]) > SAME
    ]
    was, here = (one.scenario.options.model for one in (reference, path))
    if was.policy != here.policy:
        rows.append(["torques", POLICY_TITLES[was.policy], POLICY_TITLES[here.policy]])
    if was.soil != here.soil:
        rows.append(["soil", was.soil or "none", here.soil or "none"])
    return {"kept": is_kept, "rover": rows, "drive": compare_drives(reference, path)}


def compare_drives(before: Judged, now: Judged) -> list[list[str]]:
    """Return name, value before and now of the drives along one path, up to their failures."""
    reads: Mapping[str, Callable[[Judged], str]] = {
        "verdict": lambda one: "passes" if one.verdict.traversable else "refused",
        "driven": lambda one: write(float(one.trajectory.distance[-1]), 2, "m"),
        "time": lambda one: write(float(one.trajectory.times[-1]), 1, "s"),
        "energy": lambda one: write(one.trajectory.energy, 1, "J"),
    }
    rows = [[name, read(before), read(now)] for name, read in reads.items()]
    for lane in now.limits.lanes:
        uses = [
            write_use(float(np.fmax.reduce(one.limits.lane(lane.code).used)))
            for one in (before, now)
        ]
        rows.append([lane.title, *uses])
    return [row for row in rows if row[0] == "verdict" or row[1] != row[2]]
