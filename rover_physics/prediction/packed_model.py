# SPDX-License-Identifier: Apache-2.0
"""Rover, terrain and options, checked and packed into the records that kernels read."""

from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from rover_physics.contact.contact_record import sample_wheel
from rover_physics.errors import ModelError
from rover_physics.forces.soil import pack_soils
from rover_physics.limits import table
from rover_physics.limits.table import Limit
from rover_physics.names import SERVO
from rover_physics.numerics.interruption import slices
from rover_physics.numerics.quiet import quiet
from rover_physics.numerics.records import new_record
from rover_physics.numerics.threads import limit_threads, run_chunks
from rover_physics.prediction.evaluation import (
    AHEAD,
    MODEL,
    NONE_HELD,
    SETTINGS,
    evaluate_poses,
    find_tip_over,
    new_work,
    new_works,
)
from rover_physics.prediction.halving import NO_STRETCHES
from rover_physics.prediction.known_poses import KnownPoses
from rover_physics.prediction.sweep_options import DEFAULT_OPTIONS, POLICIES, SweepOptions
from rover_physics.results.record import (
    clear_results,
    forget_uncomputable,
    unwritten_results,
)
from rover_physics.results.uses import RoverLimits, SameObject, limits_of
from rover_physics.rover.checks import check_plausible
from rover_physics.rover.linkage import pack_linkage, place, place_masses
from rover_physics.rover.manipulator import body_mass_and_com, pack_tool
from rover_physics.rover.model import Limits, Rover
from rover_physics.status import TorquePolicy
from rover_physics.terrain.grid import Terrain
from rover_physics.terrain.ground import Ground, pack_ground, with_soils

RELATIVE_COST = {TorquePolicy.EQUAL: 1, TorquePolicy.OPTIMAL: 5, TorquePolicy.SERVO: 2}
"""Time of a pose with a policy over that of a pose with equal torques."""


@dataclass(frozen=True, eq=False)
class PackedModel:
    """A rover on a terrain with options, and the same in the form that the kernels read."""

    rover: Rover
    """The rover."""
    terrain: Terrain
    """The ground."""
    options: SweepOptions
    """Torque policy, friction, soil, arm and direction."""
    records: np.ndarray
    """(1,) MODEL; with a control margin (3,), see `evaluate_poses`."""
    limits: RoverLimits
    """The limits that are asked of it."""
    ground: Ground
    """The packed terrain. The MODEL holds its addresses, so it must live as long as this one."""
    known: KnownPoses | None = field(default=None, init=False)
    """What it has found so far, None if that is not kept. A changed model begins anew."""

    def __reduce__(self) -> str:
        raise TypeError(
            "a PackedModel holds addresses of this process and cannot be pickled; "
            "pickle rover, terrain and options"
        )

    @cached_property
    def record(self) -> Any:
        """The MODEL itself; with a control margin the one of optimal torques that leave it."""
        return self.records[0]

    @cached_property
    def settings(self) -> Any:
        """Friction, torque limit, policy and the other options in force, as SETTINGS."""
        return self.record.settings

    @property
    def on_servos(self) -> bool:
        """True under policy "servo": wheels may be at their limits."""
        return self.options.policy == SERVO

    def change(self, **options: Any) -> "PackedModel":
        """Return the rover on its terrain with other values of some options."""
        asked = replace(self.options, **options)
        model = pack_model(self.rover, self.terrain, asked)
        return model.remember(self.known) if asked == self.options else model

    def remember(self, known: KnownPoses | None) -> "PackedModel":
        """Return the model with what it has found so far, which grows with what it is asked.

        It must be the same rover with the same options, and the ground near these poses the same.
        """
        if known is None:
            return self
        model = replace(self)
        object.__setattr__(model, "known", known)
        return model

    def hold_steering(self, angles: np.ndarray) -> "PackedModel":
        """Return the model with wheels at these angles (6,) [rad], whatever the motion."""
        records = self.records[:1].copy()
        records["settings"]["held_steering"] = angles
        return replace(self, records=records)

    def evaluate(
        self, poses: np.ndarray, held: np.ndarray = NONE_HELD, motions: np.ndarray = AHEAD
    ) -> Any:
        """Evaluate the model at poses and return RESULTs (n,).

        Args:
            poses: (n, 3) x, y [m] and yaw [rad] of the body origin, map frame.
            held: (n, 6, 2) height [m] and contact angle [rad] of wheels that climb a face, NaN for
                those that rest on the ground; (0, 6, 2) if none climbs.
            motions: (n, 3) vx, vy [m/s] and yaw rate [rad/s] of the body origin, as `motions_of`
                returns them; (0, 3) if all are straight ahead.
        """
        if self.known is not None and len(motions) and not len(held):
            return self.known.complete(poses, motions, self._evaluate)
        return self._evaluate(poses, motions, held)

    def evaluate_variants(
        self,
        variants: np.ndarray,
        poses: np.ndarray,
        motions: np.ndarray,
        held: np.ndarray = NONE_HELD,
    ) -> Any:
        """Evaluate variants of the model at poses and return RESULTs (n, m).

        Args:
            variants: (m, 1) or (m, 3) MODEL: records as of this model, which differ from them in
                friction, torques and masses alone.
            poses: As for `evaluate`, (n, 3).
            motions: As for `evaluate`.
            held: As for `evaluate`.
        """
        count = len(variants)
        results = unwritten_results(len(poses) * count)
        with limit_threads(self.relative_cost(len(results))) as threads:
            works = new_works(threads, len(poses))
            for part in slices(len(poses)):
                rows = results[part.start * count : part.stop * count]
                clear_results(rows)
                places = poses[part], motions[part], held[part]
                sweep = variants, self.limits.records, *places, NO_STRETCHES, works, rows
                run_chunks(evaluate_poses, sweep, len(works), threads)
                forget_uncomputable(rows)
        return results.reshape(-1, count)

    def _evaluate(
        self, poses: np.ndarray, motions: np.ndarray, held: np.ndarray = NONE_HELD
    ) -> Any:
        return self.evaluate_variants(self.records[None], poses, motions, held)[:, 0]

    def relative_cost(self, poses: int) -> int:
        """Return the time of a sweep over poses, relative to one pose with equal torques."""
        return poses * RELATIVE_COST[POLICIES[self.options.policy]]


@quiet
def pack_model(
    rover: Rover, terrain: Terrain, options: SweepOptions = DEFAULT_OPTIONS
) -> PackedModel:
    """Check rover, terrain and options and pack them for the kernels; the last 8 are cached.

    Raises:
        ModelError: An option that this rover or ground cannot have, such as a payload without an
            arm, or a rover with an implausible number.
        SoilError: A soil of the terrain, or `options.soil`, that is not a preset.
    """
    return _pack_model(SameObject(rover), terrain, options, table.LIMITS)


@lru_cache(maxsize=8)
def _pack_model(
    same: SameObject, terrain: Terrain, options: SweepOptions, rows: tuple[Limit, ...]
) -> PackedModel:
    """Pack a model for the rows of the table of limits."""
    rover: Rover = same.value
    on_soil = bool(terrain.soil_names or options.soil is not None)
    linkage, samples, settings = _pack_request(same, terrain.resolution, on_soil, options)
    soils = pack_soils(terrain.soil_names, default=options.soil)
    ground = with_soils(pack_ground(terrain), soils)
    records = np.zeros(len(settings), MODEL)
    for record, one in zip(records, settings, strict=True):
        record["ground"], record["linkage"] = ground.records[0], linkage
        record["samples"], record["settings"] = samples, one
    limits = limits_of(rover, options.policy)
    return PackedModel(rover, terrain, options, records, limits, ground)


def forget_models() -> None:
    """Forget the packed models of earlier calls, which keep their terrains in memory."""
    _pack_model.cache_clear()
    pack_ground.cache_clear()


@lru_cache(maxsize=16)
def _pack_request(
    same: SameObject, resolution: float, on_soil: bool, options: SweepOptions
) -> tuple[Any, Any, Any]:
    """Return LINKAGE, WHEEL_SAMPLES and the SETTINGS of each MODEL, cached."""
    rover, angles = same.value, options.arm_angles
    check_plausible(rover)
    mu = rover.friction if options.friction is None else options.friction
    torque = rover.wheel.max_torque if options.max_torque is None else options.max_torque
    mass, com = body_mass_and_com(rover, angles, options.payload)
    tool = pack_tool(rover, angles, options.tool_force, options.tool_moment)
    flat_angle, flat_measure = _tip_over_on_flat_ground(same)
    settings = new_record(
        SETTINGS,
        policy=POLICIES[options.policy],
        friction=float(mu),
        friction_factor=1.0,
        max_torque=float(torque),
        control_margin=float(options.kept_margin),
        servo_droop=float(rover.wheel.servo_droop),
        friction_limit=float(rover.limits.friction_utilisation),
        torque_limit=float(rover.limits.torque_saturation),
        drop_limit=float(rover.limits.wheel_drop),
        on_soil=on_soil,
        direction=options.direction,
        held_steering=np.nan,
        speed=float(min(rover.nominal_speed, rover.wheel.max_speed * rover.wheel.radius)),
        max_wheel_speed=float(rover.wheel.max_speed),
        flat_angle=flat_angle,
        flat_measure=flat_measure,
    )
    return (
        pack_linkage(rover, mass, com, tool),
        sample_wheel(rover, resolution),
        _with_fallbacks(settings, rover.limits),
    )


def _with_fallbacks(settings: Any, limits: Limits) -> tuple[Any, ...]:
    """Return SETTINGS, with a control margin followed by those of the other models."""
    _allow(settings, limits, 1.0 - settings.control_margin)
    if settings.control_margin == 0.0:
        return (settings,)
    equal, physical = settings.copy(), settings.copy()
    equal.policy, equal.control_margin = TorquePolicy.EQUAL, 0.0
    for one in (equal, physical):
        _allow(one, limits, 1.0)
    return settings, equal, physical


def _allow(settings: Any, limits: Limits, share: float) -> None:
    """Write what a share of the safety limits of friction and torque allows into SETTINGS."""
    settings.allowed_torque = settings.max_torque * limits.torque_saturation * share
    settings.allowed_friction = min(limits.friction_utilisation * share, 1.0)


@lru_cache(maxsize=4)
def _tip_over_on_flat_ground(same: SameObject) -> tuple[float, float]:
    """Return tip-over angle [rad] and force-angle measure [N m] on flat ground, arm stowed.

    Raises:
        ModelError: The rover tips over on flat ground.
    """
    rover = same.value
    linkage = pack_linkage(rover)
    work, q = new_work(), np.zeros(6)
    place(linkage, work.pose, q, work.placement)
    place_masses(linkage, q, work.placement)
    work.contacts.point[:] = work.placement.centres
    work.contacts.point[:, 2] -= linkage.radius
    angle, measure = find_tip_over(linkage, work)
    if not angle > 0.0:
        raise ModelError(
            f"rover {rover.name!r} tips over on flat ground: the centre of mass of rover, stowed "
            "arm and payload must be between its wheels"
        )
    return angle, measure
