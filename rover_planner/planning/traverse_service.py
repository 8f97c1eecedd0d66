"""The traverse server without ROS: keeps map, path and joint angles, and answers queries."""

import math
from collections.abc import Mapping
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rover_physics.names import SUSPENSION_JOINTS
from rover_physics.terrain.grid import Terrain
from rover_physics.terrain.ground import pack_ground
from rover_planner.errors import PlanningError
from rover_planner.planning.candidates import generate_candidates
from rover_planner.planning.judgement import Judgement, refusal
from rover_planner.planning.path_geometry import densify
from rover_planner.planning.path_planner import PathPlanner, PathSearch
from rover_planner.planning.path_query import Candidate
from rover_planner.planning.service_settings import ServiceSettings
from rover_planner.planning.suspension_check import compare_suspension


class TraverseService:
    """Keeps the last valid map, path and joint angles, and answers queries about them."""

    def __init__(self, settings: ServiceSettings):
        self._settings = settings
        self._received: Terrain | None = None
        self._terrain: Terrain | None = None
        self._path: NDArray[np.float64] | None = None
        self._path_refusal = "no path was received yet; publish one on ~/path"
        self._joints: dict[str, float] = {}
        # Compiles or loads the kernels, so that the first query is fast.
        generate_candidates((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))

    @property
    def settings(self) -> ServiceSettings:
        """The current settings."""
        return self._settings

    @settings.setter
    def settings(self, settings: ServiceSettings) -> None:
        self._settings = settings
        if self._received is not None:
            self.take_terrain(self._received)

    @property
    def terrain(self) -> Terrain | None:
        """The last valid map, with small gaps interpolated if so set; None if there is none."""
        return self._terrain

    @property
    def path(self) -> NDArray[np.float64] | None:
        """Poses (n, 3) of the last path; None if there is none or it was refused."""
        return self._path

    @property
    def joints(self) -> dict[str, float]:
        """Measured joint angles [rad] by name."""
        return dict(self._joints)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints whose angles are used: those of suspension and manipulator."""
        return SUSPENSION_JOINTS + self._manipulator_joints()

    def take_terrain(self, terrain: Terrain) -> None:
        """Keep a map until the next one."""
        self._terrain = (
            terrain.fill_gaps(self._settings.max_gap) if self._settings.interpolate else terrain
        )
        self._received = terrain
        pack_ground(self._terrain)  # now, so that the first query is fast

    def take_path(self, poses: NDArray[np.float64]) -> None:
        """Keep a path of poses (n, 3), x, y [m], yaw [rad], for `check_last_path`."""
        self._path = poses

    def refuse_path(self, reason: str) -> None:
        """Discard the path and keep the reason; later queries must not use an outdated one."""
        self._path = None
        self._path_refusal = f"the last path was refused: {reason}"

    def take_joints(self, positions: Mapping[str, float]) -> None:
        """Keep measured joint angles [rad] by name; angles of other joints stay."""
        self._joints.update(positions)

    def answer(self, start: ArrayLike, goal: ArrayLike, tolerance: float = 0.0) -> Judgement:
        """Find a path from start to goal, or the reason why there is none.

        Args:
            start: (3,) x, y [m], yaw [rad] of the body origin, map frame.
            goal: (3,) x, y [m], yaw [rad] of the body origin, map frame.
            tolerance: Largest distance from the goal's position [m] at which the path may end
                if the goal cannot be reached; the heading stays. 0 tries the goal only.

        Raises:
            PlanningError: The request is invalid.
            RoverError: The model refuses the request.
        """
        if not (math.isfinite(tolerance) and tolerance >= 0.0):
            raise PlanningError(f"tolerance is {tolerance}; it must be a distance of at least 0 m")
        if self._terrain is None:
            return _refuse_without_map()
        planner = self._planner(self._terrain)
        search = planner.search(
            np.asarray(start, np.float64), np.asarray(goal, np.float64), tolerance
        )
        return self._judgement(planner, search.answer.chosen, search)

    def check_last_path(self) -> Judgement:
        """Judge the last path that was received.

        Raises:
            PlanningError: The path is too long.
            RoverError: The model refuses the path.
        """
        missing = self.refuse_if_missing()
        if missing is not None:
            return missing
        assert self._path is not None
        assert self._terrain is not None
        planner = self._planner(self._terrain)
        poses = densify(self._path, self._settings.query.waypoint_spacing)
        return self._judgement(planner, planner.check(poses))

    def refuse_if_missing(self) -> Judgement | None:
        """Return a refusal if path or map is missing, else None."""
        if self._path is None:
            return refusal("no_path", self._path_refusal)
        return _refuse_without_map() if self._terrain is None else None

    def _planner(self, terrain: Terrain) -> PathPlanner:
        """Return a planner for a map, the current settings and the measured arm angles."""
        return PathPlanner(
            self._settings.rover, terrain, self._settings.query, self._manipulator_angles()
        )

    def _judgement(
        self, planner: PathPlanner, candidate: Candidate, search: PathSearch | None = None
    ) -> Judgement:
        """Return the judgement of a judged path; its classes are computed on demand."""
        return Judgement(
            candidate.verdict.code,
            candidate.verdict.reason,
            candidate,
            partial(planner.classify, candidate),
            compare_suspension(  # with the current joint angles
                candidate.prediction, self._joints, self._settings.suspension_tolerance
            ),
            search,
        )

    def _manipulator_joints(self) -> tuple[str, ...]:
        """Return the names of the manipulator's joints, () if the rover has no manipulator."""
        manipulator = self._settings.rover.manipulator
        return tuple(manipulator.joints) if manipulator is not None else ()

    def _manipulator_angles(self) -> dict[str, float] | None:
        """Return the measured manipulator angles [rad], None (stowed) until all are known."""
        names = self._manipulator_joints()
        if not names or any(name not in self._joints for name in names):
            return None
        return {name: self._joints[name] for name in names}


def _refuse_without_map() -> Judgement:
    """Return the refusal of a query before the first map."""
    return refusal(
        "no_map", "no map was received yet; publish one on elevation_cloud or call ~/load_map"
    )
