# SPDX-License-Identifier: Apache-2.0
"""A live rover: the latest values of its topics, their ages, and what is told of them."""

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rover_physics.names import SUSPENSION_JOINTS, WHEEL_JOINTS
from rover_physics.numerics.arrays import Floats
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_planner.planning.learned_ground import LearnedGround
from rover_planner.viewer.documents.paths import WORDS, describe_answer
from rover_planner.viewer.state.drive import RoverState, place_state

MAX_AGE = 2.0
"""Age from which a topic that is published all the time is stale [s]."""
TRAIL_STEP, MAX_TRAIL = 0.1, 1000
"""Distance of two places of a trail [m], and their largest number."""
ODOMETRY, SIGN_OF_LIFE = "odometry", "traverse_server"
"""Topics without which a rover, or its server, is not live."""
CLICK = "your click"
"""Name of a visitor's question."""
PATIENCE = 2.0
"""Time after which a click without an answer says so [s]."""


@dataclass
class TopicAge:
    """The age of a topic's last message."""

    heard: float | None
    """Time on the monotonic clock [s]; None if no message has come."""
    is_stream: bool
    """True if it is published all the time; others come when there is something new."""

    @property
    def age(self) -> float | None:
        """[s]; None if no message has come."""
        return None if self.heard is None else time.monotonic() - self.heard

    @property
    def is_stale(self) -> bool:
        """True if its values are no longer those of the rover."""
        return self.is_stream and self.age is not None and self.age > MAX_AGE

    def describe(self) -> str:
        """Return the age in words."""
        if self.age is None:
            return "nothing yet"
        return f"{self.age:.1f} s" if self.age < 10.0 else f"{self.age:.0f} s"


@dataclass(eq=False)
class LiveQuestion:
    """A question to the server, and its answer as far as it has come."""

    name: str
    """Whose it is, such as "question 12, can_traverse" or CLICK."""
    hash: str
    """`msg_adapters.identity.plan_request_hash` of it."""
    since: float
    """When it was asked, or its verdict was heard, on the monotonic clock [s]."""
    traversable: bool | None = None
    """True if there is a path that the rover can drive; None until the verdict comes."""
    reason: str = ""
    """Reason of a refusal."""
    plan: Floats | None = None
    """(n, 3) poses of the plan; None without one."""


@dataclass(eq=False)
class LiveData:
    """The latest data of a rover and its server; None for what has not come."""

    position: Floats | None = None
    """(3,) body origin [m], map frame."""
    attitude: Floats = field(default_factory=lambda: np.zeros(3))
    """(3,) roll, pitch, yaw [rad]."""
    speed: float = 0.0
    """[m/s]"""
    joints: Mapping[str, float] = field(default_factory=dict)
    """Angles [rad] by joint name."""
    efforts: Mapping[str, float] = field(default_factory=dict)
    """Torques [N m] by joint name."""
    forces: Mapping[str, Any] = field(default_factory=dict)
    """Quantities of a prediction that are known, and `contact_angles`."""
    forces_from: str = ""
    """Source of the forces, empty if there is none."""
    time: float = 0.0
    """Time since the first message [s]."""
    distance: float = 0.0
    """Distance driven since then [m]."""
    energy: float = 0.0
    """Work of the wheel motors since then [J]."""
    terrain: Terrain | None = None
    """The map."""
    plan: Floats | None = None
    """(n, 3) poses of the newest plan of the server, x, y [m], yaw [rad]."""
    newest: LiveQuestion | None = None
    """Last answer of the server, whoever asked."""
    click: LiveQuestion | None = None
    """The last question of a visitor; None without one."""
    learned: LearnedGround | None = None
    """Last estimate of the ground."""
    trail: Floats = field(default_factory=lambda: np.empty((0, 3)))
    """(n, 3) x, y [m] of the drive and the friction that was known there: measured, or the least
    there is."""
    ages: dict[str, TopicAge] = field(default_factory=dict)
    """The ages of all topics by name."""

    @property
    def freshness(self) -> str:
        """State of rover and server in words."""
        odometry, server = self.ages[ODOMETRY], self.ages[SIGN_OF_LIFE]
        if odometry.age is None:
            return "waiting for odometry"
        if odometry.is_stale:
            return f"not live: odometry is {odometry.age:.0f} s old"
        if server.is_stale:
            return f"the rover is live; the server is silent for {server.describe()}"
        return "live"


def read_state(rover: Rover, data: LiveData) -> RoverState | None:
    """Return the state of a rover; None before the first odometry.

    Nobody knows the forces any more once the odometry is stale.
    """
    if data.position is None:
        return None
    is_live = not data.ages[ODOMETRY].is_stale
    efforts, forces = (data.efforts, data.forces) if is_live else ({}, {})
    torques = np.array([efforts.get(name, np.nan) for name in WHEEL_JOINTS])
    return place_state(
        rover,
        data.position,
        data.attitude,
        np.array([data.joints.get(name, 0.0) for name in SUSPENSION_JOINTS]),
        spin=[data.joints.get(name, 0.0) for name in WHEEL_JOINTS],
        time=data.time,
        distance=data.distance,
        energy=data.energy,
        motion=[data.speed, 0.0, 0.0],
        tangential=torques / rover.wheel.radius,
        lateral=np.zeros(6),
        torque_saturation=np.abs(torques) / rover.wheel.max_torque,
        **forces,
    )


def choose_answer(
    data: LiveData, now: float, refusal: str = ""
) -> tuple[dict[str, Any], Floats | None]:
    """Return the answer to the last click, or without one the server's newest.

    Args:
        data: The latest data.
        now: The monotonic clock [s].
        refusal: Why a visitor's last request was refused; empty if it was not.

    Returns:
        The answer as `describe_verdict` returns one, old if nobody stands for it any more; (n, 3)
        poses of its plan, None without one.
    """
    newest, click, server, offers = data.newest, data.click, data.ages[SIGN_OF_LIFE], []
    shown = newest if click is None else click
    passes = None if shown is None else shown.traversable
    about = "" if shown is None else f"{shown.name}, {write_age(now - shown.since)}"
    if shown is None:
        headline = "click the ground to ask for a plan"
    elif passes is not None:
        headline = shown.reason
    elif now - shown.since > PATIENCE:
        headline = f"no answer from the server for {now - shown.since:.0f} s"
    else:
        headline = "asking the server"
    if click is not None and newest is not None and newest.since != click.since:
        age = write_age(now - newest.since) + (", old" if server.is_stale else "")
        words = f"{newest.name}: {WORDS[newest.traversable]}, {age}"
        offers = [{"words": words, "ask": {"ask": "newest"}}]
    is_old = passes is not None and server.is_stale
    document = {
        **describe_answer(passes, about),
        "headline": headline,
        "old": f"the server is silent for {server.describe()}" if is_old else "",
        "refusal": refusal,
        "offers": offers,
    }
    return document, data.plan if click is None else click.plan


def write_age(seconds: float) -> str:
    """Return an age in words, in steps that do not change all the time."""
    return "just now" if seconds < PATIENCE else f"{seconds:.0f} s ago"


def add_to_trail(trail: Floats, at: Floats, ground: LearnedGround) -> Floats:
    """Return a trail (n, 3), as `LiveData` has it, with what was learned at a place (2,) [m]."""
    friction = ground.mean if ground.is_bounded else ground.low
    kept = trail[-MAX_TRAIL:]
    if len(kept) > 1 and np.hypot(*(kept[-2, :2] - at)) < TRAIL_STEP:
        kept = kept[:-1]
    return np.vstack([kept, [*at, friction]])


def describe_learned(ground: LearnedGround | None) -> list[str]:
    """Return what was learned of the ground in words; none before the first estimate."""
    if ground is None:
        return []
    words = f"friction {ground.mean:.2f}, give or take {ground.std:.2f}: wheels have slipped"
    if not ground.is_bounded:
        words = f"friction at least {ground.low:.2f}: no wheel has slipped yet"
    return [words, "where: the trail in the scene, from blue (0) to yellow (1)"]
