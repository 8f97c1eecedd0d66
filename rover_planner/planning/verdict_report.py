# SPDX-License-Identifier: Apache-2.0
"""The report of a request: the verdict and its details as dataclasses and as flat JSON."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any

from rover_physics.numerics.plain_values import to_plain


@dataclass(frozen=True)
class FailureReport:
    """The first failure of a path."""

    failure_pose: tuple[float, ...]
    """x, y [m] and yaw [rad] of the first waypoint that is not passable, map frame."""
    failure_distance: float
    """Distance along the path from its start to that waypoint [m]."""


@dataclass(frozen=True)
class PathReport:
    """Length, time and energy of a judged path, and extremes over the waypoints that settled."""

    policy: str
    """Torque policy that was assumed."""
    extremes: Mapping[str, float]
    """Extremes of the verdict, its risk, and the bounds of them on an uncertain map, by the names
    of its fields; each is a key of its own."""
    waypoints: int
    """Number of waypoints."""
    length: float
    """Length of the path [m]."""
    time: float
    """Driving time [s]; NaN if the last waypoint did not settle or was not judged."""
    energy: float
    """Energy of the wheel motors [J]; NaN as for the time."""


@dataclass(frozen=True)
class ClassReport:
    """Traversability class of a path, and the waypoint that decides it."""

    traversability_class: str
    """One of `TRAVERSABILITY_CLASSES`, that of the worst waypoint; does not depend on `policy`."""
    class_waypoint: int
    """Index of the waypoint that decides the class."""
    class_constraint: str
    """Code of the limit that is violated there, else of the tightest limit."""
    class_wheel: str
    """Name of the wheel; empty if the limit does not concern a single wheel."""
    class_margin: float
    """Remaining share of that limit, negative if violated; NaN if the limit has no number."""
    class_reason: str
    """Reason why the waypoint is not passable, or not with equal torques; empty if passable."""


@dataclass(frozen=True)
class SuspensionReport:
    """Comparison of the measured suspension angles with those predicted where the rover stands."""

    suspension_mismatch: Mapping[str, float]
    """Measured minus predicted angle [rad] by joint, for the joints that were measured."""
    suspension_agrees: bool
    """Whether all of them are within the tolerance."""


@dataclass(frozen=True)
class GroundReport:
    """How much of the ground under the belly was never seen along the judged path."""

    blind_share: float
    """Share of the cells under the belly that were never seen, 0 to 1; with the next one."""
    footprint_share: float
    """Share of the cells under the belly that were filled in around the standing rover."""


@dataclass(frozen=True)
class SearchReport:
    """What was tried to find a path to the goal."""

    goal: tuple[float, ...]
    """x, y [m] and yaw [rad] of the goal of the judged path, map frame."""
    goal_offset: float
    """Distance between that goal and the requested one [m]."""
    alternative_goals_tried: int
    """Number of alternative goals that were tried."""
    candidates: int
    """Number of candidate paths to that goal."""
    traversable_candidates: int
    """Number of them that are traversable."""
    chosen_candidate: int
    """Number of the judged candidate, counted from 1: the best, or the one that gets furthest."""
    explanation: str
    """One sentence that explains the choice."""


@dataclass(frozen=True)
class IdentityReport:
    """What an answer is about: which question, which path, and which map."""

    request: int
    """Number of the question; it rises strictly while the server runs, over all its services."""
    service: str
    """Name of the service that was called, such as can_traverse."""
    server: str
    """Random text that a server keeps while it runs; another one after a restart."""
    question_hash: str
    """`msg_adapters.identity.plan_request_hash` of a plan request, or `path_hash` of the path that
    was checked."""
    path_hash: str
    """`msg_adapters.identity.path_hash` of the path that was checked or of the plan that was
    returned; empty without path."""
    path_stamp: str
    """Stamp of that path, "seconds.nanoseconds"; empty without path."""
    map_hash: str
    """Fingerprint of the map; empty without map."""
    map_stamp: str
    """Stamp of the map's header, "seconds.nanoseconds"; empty if it has none."""
    map_age: float
    """Age of the map when the question arrived [s]; NaN without map."""


@dataclass(frozen=True)
class WaypointLists:
    """Verdict and class of each waypoint; only in the JSON, because they are long.

    If there was no time for the waypoints beyond the first failure, the lists are without them.
    """

    codes: tuple[str, ...]
    """Code of the violated limit; empty if passable under `policy`."""
    reasons: tuple[str, ...]
    """Reason in words; empty if passable."""
    traversability_classes: tuple[str, ...]
    """Traversability class of each waypoint."""
    class_constraints: tuple[str, ...]
    """Per waypoint, as `ClassReport.class_constraint`."""
    class_wheels: tuple[str, ...]
    """As `class_wheel`."""
    class_margins: tuple[float, ...]
    """As `class_margin`."""


@dataclass(frozen=True)
class VerdictReport:
    """The answer to a request with all its details; parts that do not apply are None.

    The JSON has one level: the fields of the parts become keys beside those of this class. Names
    and order of the keys are those of the fields.
    """

    traversable: bool
    """Whether the rover may drive the path."""
    code: str
    """Code of the reason why not, as in a verdict or refusal; empty if traversable."""
    reason: str
    """Reason why not, in words; empty if traversable."""
    first_failure: int = -1
    """Index of the first waypoint that is not passable, -1 if none."""
    failure: FailureReport | None = None
    """The first failure of the path."""
    path: PathReport | None = None
    """The judged path; this and all fields below are None if no path was judged."""
    classes: ClassReport | None = None
    """Traversability class of the path."""
    suspension: SuspensionReport | None = None
    """Comparison with the measured suspension; None without measured joints."""
    ground: GroundReport | None = None
    """Never seen ground under the belly."""
    search: SearchReport | None = None
    """The search for the path; None if the path was given."""
    identity: IdentityReport | None = None
    """What the answer is about; None if it was not asked for over ROS."""
    waypoint_lists: WaypointLists | None = None
    """Values per waypoint."""

    @property
    def has_warning(self) -> bool:
        """Whether the measured suspension disagrees with the prediction."""
        return self.suspension is not None and not self.suspension.suspension_agrees

    def to_dict(self) -> dict[str, Any]:
        """Return all entries in JSON types: one level, None for NaN and infinity."""
        return to_plain(dict(_entries(self)))

    def summary(self) -> dict[str, Any]:
        """Return the entries of `to_dict` without those that have a value per waypoint."""
        return replace(self, waypoint_lists=None).to_dict()


def _entries(part: Any) -> Iterator[tuple[str, Any]]:
    """Yield names and values of the fields of a part; nested parts are expanded in place."""
    for field in fields(part):
        value = getattr(part, field.name)
        if is_dataclass(value):
            yield from _entries(value)
        elif field.name == "extremes":
            yield from value.items()
        elif value is not None:
            yield field.name, value
