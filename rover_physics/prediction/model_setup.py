"""What a sweep needs in the form that the kernels read, from checked arguments."""

from collections.abc import Mapping
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rover_physics.contact.wheel_samples import sample_wheel
from rover_physics.errors import ModelError
from rover_physics.forces.soil import pack_soils
from rover_physics.forces.torques import EQUAL, OPTIMAL
from rover_physics.numerics.records import new_record
from rover_physics.prediction.evaluation import SETTINGS, find_tip_over, new_work
from rover_physics.rover.linkage import pack_linkage, place, place_masses
from rover_physics.rover.manipulator import body_mass_and_com, pack_tool
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_physics.terrain.ground import Ground, pack_ground, with_soils

POLICIES = {"equal": EQUAL, "optimal": OPTIMAL}


class Setup(NamedTuple):
    """The arguments that all kernels of a sweep share."""

    ground: Ground
    """The terrain."""
    linkage: Any
    """LINKAGE: the rover with its arm, payload and tool load."""
    samples: Any
    """WHEEL_SAMPLES: points of a wheel's rim."""
    settings: Any
    """SETTINGS: what is asked for."""


def set_up(
    rover: Rover,
    terrain: Terrain,
    *,
    friction: float | None = None,
    max_torque: float | None = None,
    policy: str = "equal",
    joint_angles: Mapping[str, float] | None = None,
    payload: float | None = None,
    tool_force: ArrayLike | None = None,
    tool_moment: ArrayLike | None = None,
    soil: str | None = None,
    backward: bool = False,
) -> Setup:
    """Check the arguments of a sweep and pack them; `sweep_path` says what they are.

    Raises:
        ModelError: An argument that makes no sense.
        SoilError: A soil of the terrain, or `soil`, that is not among the presets.
    """
    same, on_soil = _SameRover(rover), bool(terrain.soil_names or soil is not None)
    angles = None if joint_angles is None else tuple(joint_angles.items())
    tool_loads = () if tool_force is None and tool_moment is None else (tool_force, tool_moment)
    pack = _pack_request.__wrapped__ if tool_loads else _pack_request
    packed = pack(
        same, terrain.resolution, policy, friction, max_torque, angles, payload, on_soil, backward,
        *tool_loads,
    )  # fmt: skip
    soils = _pack_soils(terrain.soil_names, soil)
    return Setup(with_soils(pack_ground(terrain), soils), *packed)


@lru_cache(maxsize=16)
def _pack_soils(names: tuple[str, ...], default: str | None) -> np.ndarray:
    return pack_soils(names, default=default)


class _SameRover:
    """A rover by its identity: a key for what hangs on nothing but the rover."""

    def __init__(self, rover: Rover):
        self.rover = rover

    def __hash__(self) -> int:
        return id(self.rover)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _SameRover) and self.rover is other.rover


@lru_cache(maxsize=16)
def _pack_request(
    same: _SameRover,
    resolution: float,
    policy: str,
    friction: float | None,
    max_torque: float | None,
    angles: tuple[tuple[str, float], ...] | None,
    payload: float | None,
    on_soil: bool,
    backward: bool,
    tool_force: ArrayLike | None = None,
    tool_moment: ArrayLike | None = None,
) -> tuple[Any, Any, Any]:
    """Return the fields of `Setup` after the ground, the same ones where the same is asked."""
    rover, joint_angles = same.rover, None if angles is None else dict(angles)
    if policy not in POLICIES:
        raise ModelError(f"no torque policy {policy!r}; policies are {', '.join(POLICIES)}")
    mu = rover.friction if friction is None else friction
    torque = rover.wheel.max_torque if max_torque is None else max_torque
    for name, value in (("friction", mu), ("max_torque", torque)):
        if not (np.isfinite(value) and value > 0.0):
            raise ModelError(f"{name} is {value}; it must be above 0")
    mass, com = body_mass_and_com(rover, joint_angles, payload)
    tool = pack_tool(rover, joint_angles, tool_force, tool_moment)
    flat_angle, flat_measure = _tip_over_on_flat_ground(same)
    settings = new_record(
        SETTINGS,
        policy=POLICIES[policy],
        friction=float(mu),
        max_torque=float(torque),
        allowed_torque=float(torque * rover.limits.torque_saturation),
        on_soil=on_soil,
        direction=-1.0 if backward else 1.0,
        speed=float(min(rover.nominal_speed, rover.wheel.max_speed * rover.wheel.radius)),
        max_wheel_speed=float(rover.wheel.max_speed),
        flat_angle=flat_angle,
        flat_measure=flat_measure,
    )
    return pack_linkage(rover, mass, com, tool), sample_wheel(rover, resolution), settings


@lru_cache(maxsize=4)
def _tip_over_on_flat_ground(same: _SameRover) -> tuple[float, float]:
    """Return the tip-over measures of the rover as its file has it: arm stowed, at rest."""
    rover = same.rover
    linkage = pack_linkage(rover, *body_mass_and_com(rover))
    work, q = new_work(), np.zeros(6)
    place(linkage, 0.0, 0.0, 0.0, q, work.placement)
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
