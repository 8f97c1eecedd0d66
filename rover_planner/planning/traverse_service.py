"""What a traverse server knows and decides, without ROS: map, path, joints in, judgements out."""

import itertools
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_physics.names import SUSPENSION_JOINTS
from rover_physics.rover.manipulator import body_mass_and_com
from rover_physics.rover.model import Rover
from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.grid import Terrain
from rover_physics.terrain.ground import pack_ground
from rover_physics.terrain.soil_file import soil_named
from rover_physics.traversability.classification import classify_judged
from rover_planner.errors import PlanningError
from rover_planner.planning.candidates import generate_candidates
from rover_planner.planning.judgement import Judgement, refusal
from rover_planner.planning.path_geometry import densify, rings_within
from rover_planner.planning.path_query import (
    Candidate,
    PathAnswer,
    PathQueryOptions,
    answer_path_query,
    check_path,
)

OWN_PAYLOAD = -1.0
"""Value of the parameter payload that takes what the rover file has."""
_QUERIES_PER_RING = 4


@dataclass(frozen=True)
class ServiceSettings:
    """The parameters of a traverse server, loaded and ready to use."""

    rover: Rover
    """The rover that is asked about."""
    query: PathQueryOptions
    """How candidates are made and judged."""
    interpolate: bool
    """Whether small unknown regions of a map are interpolated."""
    max_gap: float
    """Widest region that is [m]."""
    suspension_tolerance: float
    """Difference of measured and predicted suspension angles that is still agreement [rad]."""


def settings_from_parameters(values: Mapping[str, Any]) -> ServiceSettings:
    """Load what the parameters of the traverse server name.

    Args:
        values: All of the table `TRAVERSE_SERVER`, each already checked.

    Raises:
        RoverError: The rover cannot be loaded, the soil is not among the presets, or the payload
            is none for this rover.
        PlanningError: The payload is below 0 and not -1.
    """
    rover, payload, soil = load_rover(values["rover"]), values["payload"], values["soil"]
    if payload < 0.0 and payload != OWN_PAYLOAD:
        raise PlanningError(
            f"parameter payload is {payload}; it must be a mass of 0 kg or more, "
            f"or {OWN_PAYLOAD:g} for that of the rover file"
        )
    if payload != OWN_PAYLOAD:
        body_mass_and_com(rover, payload=payload)
    if soil:
        soil_named(soil)
    return ServiceSettings(
        rover=rover,
        query=PathQueryOptions(
            count=values["candidate_count"],
            spacing=values["candidate_spacing"],
            waypoint_spacing=values["waypoint_spacing"],
            policy=values["policy"],
            friction=values["friction"] or None,
            max_torque=values["max_torque"] or None,
            soil=soil or None,
            payload=None if payload == OWN_PAYLOAD else payload,
            map_sigmas=values["map_sigmas"],
        ),
        interpolate=values["unknown_cells"] == "interpolate",
        max_gap=values["max_gap"],
        suspension_tolerance=values["suspension_tolerance"],
    )


class TraverseService:
    """The last good map, path and joint angles, and the questions about them."""

    def __init__(self, settings: ServiceSettings):
        self._settings = settings
        self._received: Terrain | None = None
        self._terrain: Terrain | None = None
        self._path: NDArray[np.float64] | None = None
        self._path_refusal = "no path was received yet; publish one on ~/path"
        self._joints: dict[str, float] = {}
        # Compiles or loads kernels, so that the first question does not wait for it.
        generate_candidates((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))

    @property
    def settings(self) -> ServiceSettings:
        """The settings in force."""
        return self._settings

    @settings.setter
    def settings(self, settings: ServiceSettings) -> None:
        self._settings = settings
        if self._received is not None:
            self.take_terrain(self._received)

    @property
    def terrain(self) -> Terrain | None:
        """The last good map, small gaps filled if the settings say so."""
        return self._terrain

    @property
    def path(self) -> NDArray[np.float64] | None:
        """Poses (n, 3) of the last path, None if there is none or it could not be understood."""
        return self._path

    @property
    def joints(self) -> dict[str, float]:
        """Measured joint angles [rad] by name."""
        return dict(self._joints)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints whose angles matter: the suspension's and the manipulator's."""
        return SUSPENSION_JOINTS + self._manipulator_joints()

    def take_terrain(self, terrain: Terrain) -> None:
        """Keep a map until the next one."""
        self._terrain = (
            terrain.fill_gaps(self._settings.max_gap) if self._settings.interpolate else terrain
        )
        self._received = terrain
        pack_ground(self._terrain)  # now, so that the first question does not wait for it

    def take_path(self, poses: NDArray[np.float64]) -> None:
        """Keep a path of poses (n, 3), x, y [m], yaw [rad], to be checked."""
        self._path = poses

    def refuse_path(self, reason: str) -> None:
        """Forget the path: whoever asks next means the one that could not be understood."""
        self._path = None
        self._path_refusal = f"the last path was refused: {reason}"

    def take_joints(self, positions: Mapping[str, float]) -> None:
        """Keep measured joint angles [rad] by name; others stay as they were."""
        self._joints.update(positions)

    def answer(self, start, goal, tolerance: float = 0.0) -> Judgement:
        """Find a way from start to goal, or say why there is none.

        Args:
            start: (3,) x, y [m], yaw [rad] of the body origin, map frame.
            goal: The same.
            tolerance: How far from the goal's position the rover may end [m], where the goal
                itself cannot be reached; the heading stays. 0 is exact.

        Raises:
            PlanningError: The request has no meaning.
            RoverError: The model refuses the request.
        """
        if not (math.isfinite(tolerance) and tolerance >= 0.0):
            raise PlanningError(f"tolerance is {tolerance}; it must be a distance of at least 0 m")
        if self._terrain is None:
            return self._refuse_for_want_of_a_map()
        start, goal = np.asarray(start, np.float64), np.asarray(goal, np.float64)
        answer, reached, tried = self._query(start, goal), goal, 0
        if not answer.traversable and answer.chosen.verdict.first_failure > 0:
            for alternative in self._goals_to_stand_on(start, goal, tolerance):
                tried += 1
                other = self._query(start, alternative)
                if other.traversable:
                    answer, reached = other, alternative
                    break
        return self._judge_answer(answer, goal, reached, tried)

    def refuse_for_want(self) -> Judgement | None:
        """Refuse what needs a path and a map where there is none; None where there are both."""
        if self._path is None:
            return refusal("no_path", self._path_refusal)
        return self._refuse_for_want_of_a_map() if self._terrain is None else None

    def check_last_path(self) -> Judgement:
        """Judge the last path that was received.

        Raises:
            PlanningError: The path is too long.
            RoverError: The model refuses the path.
        """
        want = self.refuse_for_want()
        if want is not None:
            return want
        assert self._path is not None
        assert self._terrain is not None
        poses = densify(self._path, self._settings.query.waypoint_spacing)
        candidate = check_path(
            self._settings.rover,
            self._terrain,
            poses,
            self._settings.query,
            self._manipulator_angles(),
        )
        return self._judgement(candidate)

    def _query(self, start, goal) -> PathAnswer:
        """Ask for the candidates between two poses on the map."""
        assert self._terrain is not None
        return answer_path_query(
            self._settings.rover,
            self._terrain,
            start,
            goal,
            self._settings.query,
            self._manipulator_angles(),
        )

    def _goals_to_stand_on(self, start, goal, tolerance: float) -> Iterator[NDArray[np.float64]]:
        """Yield other goals at which the rover can stand, the nearest first, a few of each ring.

        A ring's goals on the start's side come first: where those cannot be reached, the ones
        behind them rarely can, and each costs a sweep of all candidates.
        """
        for ring in rings_within(start, goal, tolerance):
            standing = (pose for pose in ring if self._can_stand(pose))
            yield from itertools.islice(standing, _QUERIES_PER_RING)

    def _can_stand(self, pose: NDArray[np.float64]) -> bool:
        """Tell whether the rover can stand at a pose (3,), without asking how it gets there."""
        assert self._terrain is not None
        return check_path(
            self._settings.rover,
            self._terrain,
            pose[None, :],
            self._settings.query,
            self._manipulator_angles(),
        ).verdict.traversable

    def _judge_answer(
        self,
        answer: PathAnswer,
        goal: NDArray[np.float64],
        reached: NDArray[np.float64],
        tried: int,
    ) -> Judgement:
        """Make a judgement of the answer to a query, which says which goal it is for."""

        def notes() -> dict[str, Any]:
            passable = sum(candidate.verdict.traversable for candidate in answer.candidates)
            return {
                "candidates": len(answer.candidates),
                "traversable_candidates": passable,
                "chosen_candidate": answer.number,
                "goal": reached.tolist(),
                "goal_offset": float(np.hypot(*(reached - goal)[:2])),
                "alternative_goals_tried": tried,
                "explanation": answer.explain(),
            }

        return self._judgement(answer.chosen, notes)

    def _judgement(
        self, candidate: Candidate, notes: Callable[[], dict[str, Any]] = dict
    ) -> Judgement:
        """Make a judgement of a judged path, with all that describing it later takes."""
        assert self._terrain is not None
        query = self._settings.query
        classify = partial(
            classify_judged,
            self._settings.rover,
            self._terrain,
            candidate.prediction,
            candidate.verdict,
            query.sweep_options(self._manipulator_angles()),
            sigmas=query.map_sigmas,
        )
        verdict = candidate.verdict
        suspension = self._compare_suspension(candidate)  # with the joints as they are now

        def all_notes() -> dict[str, Any]:
            return {**suspension, **notes()}

        return Judgement(verdict.code, verdict.reason, candidate, classify, all_notes)

    def _compare_suspension(self, candidate: Candidate) -> dict[str, Any]:
        """Compare the measured suspension with the predicted one at the path's start."""
        prediction = candidate.prediction
        if not (self._joints and prediction.settled[0]):
            return {}
        predicted = dict(
            zip(
                SUSPENSION_JOINTS,
                (*prediction.rocker_angle[0], *prediction.bogie_angle[0]),
                strict=True,
            )
        )
        mismatch = {
            name: self._joints[name] - float(angle)
            for name, angle in predicted.items()
            if name in self._joints
        }
        if not mismatch:
            return {}
        largest = max(abs(difference) for difference in mismatch.values())
        return {
            "suspension_mismatch": mismatch,
            "suspension_agrees": largest <= self._settings.suspension_tolerance,
        }

    def _manipulator_joints(self) -> tuple[str, ...]:
        """Return the names of the manipulator's joints, none where the rover has none."""
        manipulator = self._settings.rover.manipulator
        return tuple(manipulator.joints) if manipulator is not None else ()

    def _manipulator_angles(self) -> dict[str, float] | None:
        """Return the measured manipulator angles, None (stowed) until all are known."""
        names = self._manipulator_joints()
        if not names or any(name not in self._joints for name in names):
            return None
        return {name: self._joints[name] for name in names}

    @staticmethod
    def _refuse_for_want_of_a_map() -> Judgement:
        """Refuse a question that came before any map."""
        return refusal(
            "no_map", "no map was received yet; publish one on elevation_cloud or call ~/load_map"
        )
