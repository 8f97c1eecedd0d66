# SPDX-License-Identifier: Apache-2.0
"""The report of a request: the verdict with all its details, as flat JSON."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from rover_physics.numerics.plain_values import to_plain

TOLD, LEARNED = "told", "learned"
"""Source of the friction of a question."""


@dataclass(frozen=True)
class SuspensionReport:
    """Comparison of the measured suspension angles with those predicted where the rover stands."""

    suspension_mismatch: Mapping[str, float]
    """Measured minus predicted angle [rad] by joint, for the joints that were measured."""
    suspension_agrees: bool
    """True if all of them are within the tolerance."""


@dataclass(frozen=True)
class IdentityReport:
    """Identity of an answer: its question, path and map."""

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
    ground: str = TOLD
    """LEARNED if the question assumed what was learned of the friction, else TOLD."""
    ground_friction: float = math.nan
    """Learned friction, assumed or only suggested; NaN if there is none."""
    ground_friction_std: float = math.nan
    """Standard deviation of it."""
    ground_since: str = ""
    """Time of that estimate, "seconds.nanoseconds"."""
    ground_classes: Mapping[str, float] = field(default_factory=dict)
    """Friction that was assumed on each class of ground of the map, where it has none of its own;
    empty unless a learned one is assumed and the map has classes."""


@dataclass(frozen=True)
class VerdictReport:
    """The answer to a request with all its details; docs/traverse_server.md explains its keys."""

    entries: Mapping[str, Any]
    """Verdict, code and reason; the judged path, if there is one, and the search for it."""
    per_waypoint: Mapping[str, Sequence[Any]] = field(default_factory=dict)
    """Verdict and class of each waypoint. If there was no time for the waypoints beyond the first
    failure, the lists are without them."""
    identity: IdentityReport | None = None
    """Its question, path and map; None if it was not asked for over ROS."""

    @property
    def has_warning(self) -> bool:
        """True if the measured suspension disagrees with the prediction."""
        return not self.entries.get("suspension_agrees", True)

    def to_dict(self) -> dict[str, Any]:
        """Return all entries in JSON types: one level, None for NaN and infinity."""
        return self.summary() | to_plain(dict(self.per_waypoint))

    def summary(self) -> dict[str, Any]:
        """Return the entries of `to_dict` without those that have a value per waypoint."""
        about = {} if self.identity is None else asdict(self.identity)
        plain: dict[str, Any] = to_plain({**self.entries, **about})
        return plain
