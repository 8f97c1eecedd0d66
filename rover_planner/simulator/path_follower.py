"""Path following by pure pursuit: speed and yaw rate that keep the rover on a path."""

import numpy as np

from rover_physics.numerics.arrays import Floats

ARRIVED = 0.25
"""Distance from the end at which the path counts as finished, in look-ahead distances."""


class PathFollower:
    """Pure pursuit of a path.

    Source: Coulter, "Implementation of the pure pursuit path tracking algorithm", 1992.
    """

    def __init__(self, poses: Floats, look_ahead: float):
        """Follow poses (n, 3) with a look-ahead distance [m] along them."""
        self._places = np.asarray(poses, dtype=float)[:, :2]
        steps = np.hypot(*np.diff(self._places, axis=0).T)
        self._along = np.concatenate([[0.0], np.cumsum(steps)])
        self._look_ahead = look_ahead
        self._done = 0.0

    @property
    def length(self) -> float:
        """Length of the path [m]."""
        return float(self._along[-1])

    @property
    def driven(self) -> float:
        """Distance driven along the path [m]."""
        return self._done

    def has_arrived(self, pose: Floats) -> bool:
        """Return whether a pose (3,) is at the end of the path."""
        left = float(np.hypot(*(self._places[-1] - pose[:2])))
        near = left < ARRIVED * self._look_ahead
        return near or self._done >= self.length - 1e-6

    def steer(self, pose: Floats, speed: float) -> tuple[float, float]:
        """Return speed [m/s] and yaw rate [rad/s] at a pose (3,); zeros at the end."""
        self._project(pose)
        if self.has_arrived(pose):
            return 0.0, 0.0
        target = self._at(self._done + self._look_ahead)
        way = target - pose[:2]
        across = -np.sin(pose[2]) * way[0] + np.cos(pose[2]) * way[1]
        curvature = 2.0 * across / max(float(way @ way), 1e-6)
        most = 1.0 / self._look_ahead
        return speed, speed * float(np.clip(curvature, -most, most))

    def _project(self, pose: Floats) -> None:
        """Advance to the point of the path nearest to the pose; never move backwards."""
        ahead = np.linspace(self._done, min(self._done + self._look_ahead, self.length), 40)
        places = np.array([self._at(along) for along in ahead])
        away = np.hypot(*(places - pose[:2]).T)
        self._done = float(ahead[int(np.argmin(away))])

    def _at(self, along: float) -> Floats:
        """Return the point (2,) at a distance along the path [m], extended straight on."""
        over = max(along - self.length, 0.0)
        x, y = (np.interp(along, self._along, self._places[:, k]) for k in (0, 1))
        if over > 0.0 and len(self._places) > 1:
            last = self._places[-1] - self._places[-2]
            direction = last / max(float(np.hypot(*last)), 1e-9)
            return np.array([x, y]) + over * direction
        return np.array([x, y])
