# SPDX-License-Identifier: Apache-2.0
"""The levers by which a refused path may pass: one row each, from which all advice follows.

A new lever is one row of LEVERS: what it may be set to, how it changes a case, and its words.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rover_physics.limits.table import LIMITS, Limit, Sense
from rover_physics.names import OPTIMAL, SERVO
from rover_physics.rover.extent import find_reach
from rover_physics.rover.manipulator import arm_angles, link_points
from rover_physics.rover.steering_joints import can_turn_on_the_spot, swing_radius
from rover_physics.terrain.grid import Terrain, cut_around
from rover_physics.traversability.entrapment import MAX_LOOK_AHEAD
from rover_planner.advice.case import MOST_FRICTION, Case, JudgedCase
from rover_planner.advice.path_changes import (
    bend_path,
    is_driven_ahead,
    pass_by,
    reverse_rover,
    shift_path,
    turn_path,
)
from rover_planner.planning.path_geometry import distance_along

ASIDE = 2.0
"""Largest shift of a path [wheelbases]."""
ASKEW = 0.6
"""Largest other angle at which a place is crossed [rad]."""
MOST_TORQUE = 3.0
"""Largest torque that is asked for, over that of the motors."""
MOST_RELAXED = 1.5
"""Largest limit that is asked for, over that of the rover file."""
ROCK_RADIUS = 4.0
"""Radius of the ground that is lowered [wheel radii]."""
LEVEL = 1e-9
"""Height by which an arm may be lower [m] because of rounding."""
TELLING_MOVE = 0.01
"""Least move of the arm's tip along the body that is told [m]."""
TORQUES = {OPTIMAL: "Switch on traction control", SERVO: "Drive the wheels by speed servos"}


@dataclass(frozen=True)
class Span:
    """The range of a lever: any value from now to either end."""

    now: float
    """The value of the refused case."""
    ends: tuple[float, ...]
    """The values farthest from it, on one side or both."""

    def shares(self, steps: Sequence[float]) -> list[float]:
        """Return steps [share of the range] to the ends, negative to the first one of two."""
        signs = (-1.0, 1.0) if len(self.ends) == 2 else (1.0,)
        return [sign * step for step in steps for sign in signs]

    def value_at(self, share: float) -> float:
        """Return the value at a share of the range."""
        end = self.ends[0 if share < 0.0 else -1]
        return self.now + abs(share) * (end - self.now)


@dataclass(frozen=True)
class Choice:
    """The values of a lever: one of a few."""

    now: Any
    """The value of the refused case."""
    values: tuple[Any, ...]
    """The others, nearest first."""

    def shares(self, _steps: Sequence[float]) -> list[float]:
        """Return 1, 2, ... for the values, whatever the steps."""
        return [float(k + 1) for k in range(len(self.values))]

    def value_at(self, share: float) -> Any:
        """Return the value of a number from 1 on."""
        return self.values[int(share) - 1]


@dataclass(frozen=True)
class Lever:
    """One thing that may be changed about a case."""

    name: str
    """Name of the lever."""
    unit: str
    """Unit of its values; empty for a ratio or a word."""
    settings: Callable[[JudgedCase], Span | Choice | None]
    """Returns what it may be set to; None where it cannot be used."""
    apply: Callable[[Case, JudgedCase, Any], Case | None]
    """Returns a case with the lever set; None where there is no room."""
    words: Callable[[JudgedCase, Any, Any], str]
    """Returns what to do in words, for a value and that of now."""
    keeps_rows: bool = True
    """True if waypoints stay, or are only shifted: row i is near row i of the refused path."""
    changes_path: bool = False
    """True if it changes the path. Only one such lever is set at a time."""
    needs_others: bool = False
    """True if somebody outside the rover has to do, to know or to decide something."""
    option: str = ""
    """The option of `predict` that it sets; empty if it sets none."""


def _policies(refusal: JudgedCase) -> Choice:
    now = refusal.case.options.policy
    return Choice(now, tuple(policy for policy in (SERVO, OPTIMAL) if policy != now))


def _arm_joint(k: int, raised: str, lowered: str) -> Lever:
    """Return the lever of a joint of the arm; the words are those of a smaller or larger angle."""

    def settings(refusal: JudgedCase) -> Span | None:
        arm = refusal.case.rover.manipulator
        if arm is None:
            return None
        now = float(arm_angles(arm, refusal.case.options.arm_angles)[k])
        return Span(
            now, tuple(arm.joint_limits[k]) if arm.joint_limits else (now - np.pi, now + np.pi)
        )

    def apply(case: Case, _refusal: JudgedCase, angle: float) -> Case | None:
        arm = case.rover.manipulator
        assert arm is not None
        angles = arm_angles(arm, case.options.arm_angles)
        lowest = min(arm.base[2], link_points(arm, angles)[:, 2].min())
        angles[k] = angle
        if link_points(arm, angles)[:, 2].min() < lowest - LEVEL:
            return None  # below its foot it may hit the body, which the model does not know
        return case.change(joint_angles=dict(zip(arm.joints, angles.tolist(), strict=True)))

    def words(refusal: JudgedCase, angle: float, now: float) -> str:
        turn = angle - now
        verb = lowered if turn > 0.0 else raised
        return f"{verb.format(f'{abs(turn):.2f} rad')}{_tip_move(refusal, k, angle)}"

    name = ("arm_yaw", "arm_shoulder", "arm_elbow")[k]
    return Lever(name, "rad", settings, apply, words, option="joint_angles")


def _tip_move(refusal: JudgedCase, k: int, angle: float) -> str:
    """Return where the tip of the arm moves along the body with another angle of joint k."""
    arm = refusal.case.rover.manipulator
    assert arm is not None
    angles = arm_angles(arm, refusal.case.options.arm_angles)
    before = link_points(arm, angles)[-1, 0]
    angles[k] = angle
    ahead = float(link_points(arm, angles)[-1, 0] - before)
    if abs(ahead) < TELLING_MOVE:
        return ""
    return f", its tip {abs(ahead):.2f} m to the {'front' if ahead > 0.0 else 'rear'}"


def _payload(refusal: JudgedCase) -> Span | None:
    arm = refusal.case.site.assumed_rover.manipulator
    now = 0.0 if arm is None else arm.payload
    return Span(now, (0.0,)) if now > 0.0 else None


def _describe_payload(_refusal: JudgedCase, payload: float, now: float) -> str:
    if payload == 0.0:
        return "Put the payload down"
    return f"Carry {now - payload:.2f} kg less at the arm's tip"


def _aside(refusal: JudgedCase) -> Span | None:
    """Return how far a path that is driven ahead may be shifted [m]."""
    most = ASIDE * refusal.case.rover.wheelbase
    return Span(0.0, (-most, most)) if is_driven_ahead(refusal.case.poses) else None


def _askew(refusal: JudgedCase) -> Span | None:
    return Span(0.0, (-ASKEW, ASKEW)) if is_driven_ahead(refusal.case.poses) else None


def _on_the_spot(refusal: JudgedCase) -> Span | None:
    return _aside(refusal) if can_turn_on_the_spot(refusal.case.rover) else None


def _around(refusal: JudgedCase) -> Choice | None:
    """Return the length of a path around [m], if one is found."""
    if refusal.distance[-1] < refusal.case.rover.wheelbase or refusal.path_around is None:
        return None
    length = float(distance_along(refusal.path_around)[-1])
    return Choice(float(refusal.distance[-1]), (length,))


def _describe_path_around(refusal: JudgedCase, length: float, now: float) -> str:
    """Return where a path around is farthest from the refused one, and its length."""
    old, new = refusal.case.poses, refusal.path_around
    assert new is not None
    steps = new[:, None, :2] - old[None, :, :2]
    nearest = np.hypot(steps[..., 0], steps[..., 1]).argmin(axis=1)
    x, y = (new - old[nearest])[:, :2].T
    aside = np.cos(old[nearest, 2]) * y - np.sin(old[nearest, 2]) * x
    farthest = int(np.abs(aside).argmax())
    return (
        f"Drive around, up to {abs(aside[farthest]):.2f} m {_side(aside[farthest])} of the path: "
        f"{length:.1f} m in place of {now:.1f} m"
    )


def _backward(refusal: JudgedCase) -> Choice | None:
    case = refusal.case
    turns = can_turn_on_the_spot(case.rover) and is_driven_ahead(case.poses)
    return Choice(False, (True,)) if turns and not case.options.backward else None


def _reverse(case: Case, _refusal: JudgedCase, _value: Any) -> Case:
    step = _spacing(case) / swing_radius(case.rover)
    return replace(case.change(backward=True), poses=reverse_rover(case.poses, step))


def _spacing(case: Case) -> float:
    """Return the distance of waypoints [m] of a path of its own, where it does not turn."""
    steps = np.diff(distance_along(case.poses))
    driven = steps[steps > 0.0]
    return float(np.median(driven)) if len(driven) else case.site.options.waypoint_spacing


def _with_path(change: Callable[[Case, JudgedCase, float], Any]) -> Callable[..., Case | None]:
    """Return what sets a lever by a function that returns a path."""

    def apply(case: Case, refusal: JudgedCase, value: float) -> Case | None:
        poses = change(case, refusal, value)
        return None if poses is None else replace(case, poses=poses)

    return apply


def _side(value: float) -> str:
    return "left" if value > 0.0 else "right"


def _at(refusal: JudgedCase) -> str:
    return f"{refusal.distance[refusal.place]:.1f} m"


def _friction(refusal: JudgedCase) -> Span | None:
    case = refusal.case
    if case.terrain.friction is not None or case.terrain.soil is not None or case.options.soil:
        return None  # the ground has its own
    now = case.site.assumed_rover.friction
    return Span(now, (MOST_FRICTION,)) if now < MOST_FRICTION else None


def _torque(refusal: JudgedCase) -> Span:
    now = refusal.case.site.assumed_rover.wheel.max_torque
    return Span(now, (MOST_TORQUE * now,))


def _rock(refusal: JudgedCase) -> Span | None:
    """Return by how much the ground below the highest wheel may be cut down [m]."""
    heights = refusal.case.terrain.elevation[_disc(refusal.case.terrain, refusal)]
    heights = heights[np.isfinite(heights)]
    height = float(heights.max() - np.median(heights)) if heights.size else 0.0
    return Span(0.0, (height,)) if height > 0.0 else None


def _disc(terrain: Terrain, refusal: JudgedCase) -> Any:
    """Return the mask (ny, nx) of the cells around the place of the failure."""
    x, y = refusal.place_on_ground
    ny, nx = terrain.elevation.shape
    columns = terrain.origin[0] + terrain.resolution * np.arange(nx) - x
    rows = terrain.origin[1] + terrain.resolution * np.arange(ny) - y
    away = np.hypot(columns, rows[:, None])
    return away <= ROCK_RADIUS * refusal.case.rover.wheel.radius


def _lower_rock(case: Case, refusal: JudgedCase, depth: float) -> Case:
    """Return the case on the ground around its path, which may be a small part of a map."""
    around = find_reach(case.rover) + MAX_LOOK_AHEAD * case.rover.wheelbase
    part = cut_around(case.terrain, case.poses[:, :2], around)
    disc, heights = _disc(part, refusal), part.elevation.copy()
    heights[disc] = np.minimum(heights[disc], np.nanmax(heights[disc]) - depth)
    return case.change_site(terrain=replace(part, elevation=heights))


def _describe_rock(refusal: JudgedCase, depth: float, _now: float) -> str:
    x, y = refusal.place_on_ground
    return f"The ground at ({x:.2f}, {y:.2f}) would have to be {100.0 * depth:.0f} cm lower"


def _limit(row: Limit) -> Lever:
    """Return the lever that relaxes a limit of the rover file."""

    def settings(refusal: JudgedCase) -> Span | None:
        now = float(getattr(refusal.case.rover.limits, row.reads))
        if row.code not in refusal.verdict.codes:
            return None
        return Span(now, (MOST_RELAXED * now if row.sense == Sense.MOST else 0.0,))

    def apply(case: Case, _refusal: JudgedCase, bound: float) -> Case:
        changed: dict[str, Any] = {row.reads: bound}
        limits = replace(case.rover.limits, **changed)
        return case.change_site(rover=replace(case.rover, limits=limits))

    def words(_refusal: JudgedCase, bound: float, now: float) -> str:
        name = row.reads.replace("_", " ")
        return (
            f"A limit of {row.unit.write(bound)} for {name} would do, in place of "
            f"{row.unit.write(now)}: a decision, no remedy"
        )

    return Lever(
        f"limits.{row.reads}", "rad" if row.reads == "tilt" else row.unit.name, settings, apply,
        words, needs_others=True,
    )  # fmt: skip


LEVERS: tuple[Lever, ...] = (
    Lever(
        "policy", "", _policies, lambda case, _refusal, policy: case.change(policy=policy),
        lambda _refusal, policy, _now: TORQUES[policy], option="policy",
    ),
    _arm_joint(1, "Lift the arm by {}", "Lower the arm by {}"),
    _arm_joint(0, "Swing the arm by {} to the right", "Swing the arm by {} to the left"),
    _arm_joint(2, "Raise the forearm by {}", "Lower the forearm by {}"),
    Lever(
        "payload", "kg", _payload, lambda case, _refusal, mass: case.change(payload=mass),
        _describe_payload, option="payload",
    ),
    Lever(
        "shift", "m", _aside,
        _with_path(lambda case, refusal, offset: shift_path(
            case.poses, refusal.place, offset, case.rover.wheelbase)),
        lambda refusal, offset, _now:
            f"Drive {abs(offset):.2f} m further {_side(offset)} around {_at(refusal)}",
        changes_path=True,
    ),
    Lever(
        "approach_angle", "rad", _askew,
        _with_path(lambda case, refusal, angle: turn_path(
            case.poses, refusal.place, angle, case.rover.wheelbase)),
        lambda refusal, angle, _now: f"Cross the place at {_at(refusal)} at an angle of "
            f"{np.degrees(abs(angle)):.0f} degrees to the {_side(angle)}",
        changes_path=True,
    ),
    Lever(
        "curve", "m", _aside,
        _with_path(lambda case, _refusal, offset: bend_path(case.poses, offset)),
        lambda _refusal, offset, _now:
            f"Drive a curve that leads {abs(offset):.2f} m to the {_side(offset)}",
        changes_path=True,
    ),
    Lever(
        "turn_on_the_spot", "m", _on_the_spot,
        _with_path(lambda case, refusal, offset: pass_by(
            case.poses, refusal.place, offset, swing_radius(case.rover), _spacing(case))),
        lambda refusal, offset, _now: f"Turn on the spot, pass {abs(offset):.2f} m "
            f"{_side(offset)} of the place at {_at(refusal)}, stop and turn on the spot to "
            "the goal",
        changes_path=True, keeps_rows=False,
    ),
    Lever(
        "path_around", "m", _around,
        _with_path(lambda _case, refusal, _length: refusal.path_around), _describe_path_around,
        changes_path=True, keeps_rows=False,
    ),
    Lever(
        "backward", "", _backward, _reverse,
        lambda _refusal, _value, _now: "Turn round and drive it backwards", keeps_rows=False,
        option="backward",
    ),
    Lever(
        "friction", "", _friction, lambda case, _refusal, mu: case.change(friction=mu),
        lambda _refusal, mu, now: f"A friction of {mu:.2f} would do; {mu - now:.2f} is missing",
        needs_others=True, option="friction",
    ),
    Lever(
        "max_torque", "N m", _torque, lambda case, _refusal, most: case.change(max_torque=most),
        lambda _refusal, most, now: f"Motors of {most:.2f} N m would do; "
            f"{most - now:.2f} N m are missing",
        needs_others=True, option="max_torque",
    ),
    Lever("ground", "m", _rock, _lower_rock, _describe_rock, needs_others=True),
    *(
        _limit(row)
        for row in LIMITS
        if row.reads in ("tilt", "tip_over_ratio", "wheel_drop", "belly_clearance")
    ),
)  # fmt: skip
"""All levers: first what the rover does by itself, cheapest first, then what needs others."""
