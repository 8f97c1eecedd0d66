# SPDX-License-Identifier: Apache-2.0
"""Transforms between frames with their times, as on /tf, and where sensors are mounted."""

import bisect
import math
import threading
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from msg_adapters.stamps import NANOSECONDS
from rover_physics.numerics.quaternions import rpy_from_xyzw
from rover_planner.errors import PlanningError
from rover_planner.parameters.traverse_server import NO_MOUNTS

MEMORY = 10_000_000_000
"""Time for which transforms are kept [ns], as in tf2."""
MOST_AHEAD = 10_000_000_000
"""Lead of a stamp over the present from which it is of another clock [ns]: localisation dates its
transforms ahead by about a second."""
SET_BACK = 1_000_000_000
"""Lead of the last stamp from which the clock was set back [ns]: messages that overtake each other
differ by less."""

MOUNT_FORM = "frame:x:y:z:roll:pitch:yaw, such as front_camera:0.3:0.0:0.4:0.0:0.5:0.0"
"""Form of an entry of the parameter sensor_mounts, for error texts."""
MAX_ARM = 100.0
"""Largest distance of a sensor from the robot's frame along an axis [m]."""


class TransformError(PlanningError):
    """Two frames are not connected, or a transform is not known at the time that is asked for."""


@dataclass(frozen=True, eq=False)
class Rigid:
    """A rotation and a translation: p in the child frame is `rotation p + translation`."""

    translation: NDArray[np.float64]
    """(3,) x, y, z [m]."""
    rotation: Rotation
    """The rotation."""

    @staticmethod
    def from_rpy(x: float, y: float, z: float, roll: float, pitch: float, yaw: float) -> "Rigid":
        """Return a transform of a position [m] and angles [rad]; yaw is applied last."""
        return Rigid(np.array([x, y, z]), Rotation.from_euler("xyz", [roll, pitch, yaw]))

    @staticmethod
    def of(place: Any, turn: Any) -> "Rigid":
        """Return the transform of a message's position and quaternion."""
        rotation = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w])
        return Rigid(np.array([place.x, place.y, place.z]), rotation)

    @staticmethod
    def none() -> "Rigid":
        """Return the transform that changes nothing."""
        return Rigid(np.zeros(3), Rotation.identity())

    def then(self, inner: "Rigid") -> "Rigid":
        """Return the transform that applies `inner` first, then this one."""
        return Rigid(
            self.rotation.apply(inner.translation) + self.translation,
            self.rotation * inner.rotation,
        )

    def inverse(self) -> "Rigid":
        """Return the transform back."""
        back = self.rotation.inv()
        return Rigid(-back.apply(self.translation), back)

    @property
    def matrix(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(3, 3) rotation matrix and (3,) translation [m]."""
        return self.rotation.as_matrix(), self.translation

    @property
    def xyyaw(self) -> NDArray[np.float64]:
        """(3,) x, y [m] and yaw [rad] of the child frame's origin and x axis."""
        ahead = self.rotation.apply([1.0, 0.0, 0.0])
        return np.array([*self.translation[:2], np.arctan2(ahead[1], ahead[0])])

    @property
    def xyzrpy(self) -> NDArray[np.float64]:
        """(6,) x, y, z [m], roll, pitch, yaw [rad], as for `from_rpy`."""
        x, y, z, w = self.rotation.as_quat().tolist()
        return np.array([*self.translation, *rpy_from_xyzw((x, y, z, w))])


@dataclass
class _Edge:
    """The transforms of one child frame in the last time, in the order of their stamps."""

    parent: str
    is_static: bool
    stamps: list[int] = field(default_factory=list)
    rigids: list[Rigid] = field(default_factory=list)

    def add(self, stamp: int, rigid: Rigid) -> None:
        """Keep a transform; of a static one only the last."""
        at = 0 if self.is_static else bisect.bisect_left(self.stamps, stamp)
        known = self.is_static or stamp in self.stamps[at : at + 1]
        self.stamps[at : at + known], self.rigids[at : at + known] = [stamp], [rigid]
        old = bisect.bisect_left(self.stamps, self.stamps[-1] - MEMORY)
        del self.stamps[:old], self.rigids[:old]

    def at(self, time: int) -> Rigid:
        """Return the transform at a time; beyond the ends that of the nearest stamp."""
        after = bisect.bisect_left(self.stamps, time)
        if self.is_static or after == 0:
            return self.rigids[0]
        if after == len(self.stamps):
            return self.rigids[-1]
        first, last = self.stamps[after - 1], self.stamps[after]
        share = (time - first) / (last - first)
        a, b = self.rigids[after - 1], self.rigids[after]
        turn = Slerp([0.0, 1.0], Rotation.concatenate([a.rotation, b.rotation]))
        return Rigid((1.0 - share) * a.translation + share * b.translation, turn(share))


class TransformTree:
    """Keeps the transforms of the last seconds; each frame has one parent.

    Several threads may use it.
    """

    def __init__(self, timeout: float):
        self.timeout = timeout
        """Age from which a transform is stale [s]."""
        self._edges: dict[str, _Edge] = {}
        self._lock = threading.Lock()

    def take(
        self, parent: str, child: str, stamp: int, rigid: Rigid, *, is_static: bool = False
    ) -> None:
        """Keep where a child frame is in its parent frame at a time [ns].

        With another parent, or a clock set back, the old transforms of the child are dropped.
        """
        with self._lock:
            edge = self._edges.get(child)
            stale = edge is not None and edge.stamps[-1] - stamp > SET_BACK
            if edge is None or edge.parent != parent or edge.is_static != is_static or stale:
                edge = self._edges[child] = _Edge(parent, is_static)
            edge.add(stamp, rigid)

    def knows(self, frame: str) -> bool:
        """Return whether a frame is the parent or the child of a transform."""
        return frame in self.frames()

    def frames(self) -> set[str]:
        """Return the names of all frames."""
        with self._lock:
            return {*self._edges, *(edge.parent for edge in self._edges.values())}

    def has_parent(self, frame: str) -> bool:
        """Return whether a frame is the child of a transform."""
        return frame in self._edges

    def connects(self, one: str, other: str) -> bool:
        """Return whether transforms lead from one frame to another, of whatever age.

        Raises:
            TransformError: Transforms form a circle.
        """
        with self._lock:
            return not set(self._chain(one)).isdisjoint(self._chain(other))

    def find(self, target: str, source: str, time: int | None, now: int) -> Rigid:
        """Return where the source frame is in the target frame.

        Args:
            target: Name of the frame to transform to.
            source: Name of the frame to transform from.
            time: Time [ns, ROS time]; None is the newest that all transforms between them have.
            now: Present time [ns, ROS time].

        Raises:
            TransformError: A frame is not known, the frames are not connected, a transform is
                older than the timeout, or not kept for so long; the newest is from the future.
        """
        if target == source:
            return Rigid.none()
        with self._lock:
            up, down = self._chain(source), self._chain(target)
            shared = next((frame for frame in up if frame in down), None)
            if shared is None:
                raise TransformError(f"no transforms connect the frames {source!r} and {target!r}")
            steps = up[: up.index(shared)], down[: down.index(shared)]
            moving = [c for part in steps for c in part if not self._edges[c].is_static]
            newest = min((self._edges[c].stamps[-1] for c in moving), default=now)
            if time is None and newest - now > MOST_AHEAD:
                lead = (newest - now) / NANOSECONDS
                raise TransformError(
                    f"the newest transform from {source!r} to {target!r} is {lead:.1f} s in the "
                    "future; check the clocks"
                )
            at = newest if time is None else time
            for child in moving:
                self._check(child, at, now)
            found = [Rigid.none(), Rigid.none()]
            for side, part in enumerate(steps):
                for child in part:
                    found[side] = self._edges[child].at(at).then(found[side])
        return found[1].inverse().then(found[0])

    def _chain(self, frame: str) -> list[str]:
        """Return a frame, its parent, the parent of that, and so on."""
        chain = [frame]
        while chain[-1] in self._edges:
            parent = self._edges[chain[-1]].parent
            if parent in chain:
                raise TransformError(
                    f"the transforms of {', '.join(chain)} form a circle; one frame has no parent"
                )
            chain.append(parent)
        return chain

    def _check(self, child: str, time: int, now: int) -> None:
        """Raise if the transform of a child frame is stale, or not known at a time."""
        edge = self._edges[child]
        names = f"the transform from {child!r} to {edge.parent!r}"
        age = (max(now, time) - edge.stamps[-1]) / NANOSECONDS
        if age > self.timeout:
            raise TransformError(
                f"{names} is stale: it is {age:.3f} s old, transform_timeout is {self.timeout:g} s"
            )
        early = (edge.stamps[0] - time) / NANOSECONDS
        if early > self.timeout:
            raise TransformError(
                f"{names} is not known {early:.3f} s before the oldest that is kept; use stamp 0 "
                "for the newest"
            )


def read_mounts(entries: Sequence[str]) -> dict[str, Rigid]:
    """Return the mounts of the parameter sensor_mounts by the names of their frames.

    Raises:
        PlanningError: An entry has another form, or a frame has two.
    """
    mounts: dict[str, Rigid] = {}
    for entry in () if entries == NO_MOUNTS else entries:
        name, *rest = (part.strip() for part in entry.split(":"))
        try:
            numbers = [float(text) for text in rest]
        except ValueError:
            numbers = []
        far = [n for n in numbers[:3] if not abs(n) <= MAX_ARM]
        turned = [n for n in numbers[3:] if not abs(n) <= 2.0 * math.pi]
        if len(numbers) != 6 or not name or far or turned:
            raise PlanningError(
                f"sensor_mounts has {entry!r}; it must be {MOUNT_FORM}, with lengths in m up to "
                f"{MAX_ARM:g} and angles in rad up to 2 pi"
            )
        if name in mounts:
            raise PlanningError(f"sensor_mounts has the frame {name!r} twice; it has one mount")
        x, y, z, roll, pitch, yaw = numbers
        mounts[name] = Rigid.from_rpy(x, y, z, roll, pitch, yaw)
    return mounts
