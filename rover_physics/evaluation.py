"""The full model at one pose, and the compiled sweep of it over many poses."""

from typing import NamedTuple

import numpy as np
from numba import prange

from rover_physics.clearance import belly_clearance
from rover_physics.contact import Touch, new_touch
from rover_physics.equilibrium import (
    FREE_FORCES,
    Balance,
    balance_forces,
    new_balance,
    tool_load,
)
from rover_physics.ground import friction_at
from rover_physics.kernels import allocating_kernel, kernel, sweep_kernel
from rover_physics.linkage import Placement, new_placement, place_masses
from rover_physics.settling import SETTLED, settle
from rover_physics.soil import coulomb_slip, effective_friction, solve_wheel
from rover_physics.soil_sharing import share_forces_on_soil
from rover_physics.stability import CORNERS, find_support, tip_over_angles
from rover_physics.torques import (
    EQUAL,
    TorqueSearch,
    minimise_friction,
    new_torque_search,
    take_equal_torques,
)

NO_EQUILIBRIUM = 4
CHUNK = 16
"""Poses that share one work space; small enough to keep all cores busy."""


class Settings(NamedTuple):
    """What a sweep is asked for."""

    policy: int
    """EQUAL or OPTIMAL."""
    friction: float
    """Friction coefficient where the terrain gives none."""
    max_torque: float
    """Largest wheel torque [N m]."""
    allowed_torque: float
    """Largest wheel torque within the safety limit [N m]."""
    on_soil: bool
    """Whether anything but the ground's own Coulomb friction may hold."""
    soils: np.ndarray
    """(1 + k, 8) table of `pack_soils`: the default soil, then those of the terrain's layer."""
    direction: float
    """1 where the rover drives forwards, -1 backwards."""
    speed: float
    """Speed of the wheels over the ground [m/s]."""
    max_wheel_speed: float
    """Largest wheel speed [rad/s]."""
    flat_angle: float
    """Tip-over angle on flat ground [rad]."""
    flat_measure: float
    """Force-angle measure on flat ground [N m]."""


class Columns(NamedTuple):
    """Results, a row per pose; see `PathPrediction`."""

    status: np.ndarray
    q: np.ndarray
    centres: np.ndarray
    points: np.ndarray
    contact_angle: np.ndarray
    N: np.ndarray
    T: np.ndarray
    S: np.ndarray
    torque: np.ndarray
    friction: np.ndarray
    utilisation: np.ndarray
    slip: np.ndarray
    saturation: np.ndarray
    tip_over_ratio: np.ndarray
    force_angle: np.ndarray
    clearance: np.ndarray
    power: np.ndarray
    sinkage: np.ndarray
    resistance: np.ndarray


def new_columns(n: int) -> Columns:
    """Return results of n poses, all NaN."""

    def blank(*shape: int) -> np.ndarray:
        return np.full((n, *shape), np.nan)

    per_wheel = [blank(6) for _ in range(9)]
    per_pose = [blank() for _ in range(4)]
    last = [blank(6) for _ in range(2)]
    return Columns(
        np.zeros(n, np.int8), blank(6), blank(6, 3), blank(6, 3), *per_wheel, *per_pose, *last
    )


class Work(NamedTuple):
    """Work space of one thread."""

    placement: Placement
    touch: Touch
    balance: Balance
    search: TorqueSearch
    J: np.ndarray
    step: np.ndarray
    corners: np.ndarray
    vectors: np.ndarray
    soil_rows: np.ndarray
    best: np.ndarray


@allocating_kernel
def new_work(samples):
    """Return empty work space."""
    return Work(
        new_placement(),
        new_touch(samples),
        new_balance(),
        new_torque_search(),
        np.empty((6, 6)),
        np.empty((6, 1)),
        np.empty((CORNERS, 3)),
        np.empty((3, 3)),
        np.zeros(6, np.int64),
        np.empty((3, 6)),
    )


@sweep_kernel
def evaluate_poses(ground, linkage, samples, settings, poses, held, columns):
    """Evaluate the model at poses (n, 3) into `columns`, each pose on its own.

    held (n, 6, 2) gives height [m] and contact angle [rad] of wheels that climb a face, NaN for
    those that rest on the ground; (0, 6, 2) where none climbs.
    """
    n = poses.shape[0]
    for chunk in prange((n + CHUNK - 1) // CHUNK):
        work = new_work(samples)
        for i in range(chunk * CHUNK, min((chunk + 1) * CHUNK, n)):
            evaluate_pose(ground, linkage, samples, settings, poses, held, i, work, columns)


@kernel
def evaluate_pose(ground, linkage, samples, settings, poses, held, i, work, columns):
    """Evaluate the model at pose i into row i of `columns`."""
    q, placement, touch = columns.q[i], work.placement, work.touch
    for wheel in range(6 if held.shape[0] > 0 else 0):
        touch.held_height[wheel] = held[i, wheel, 0]
        touch.held_angle[wheel] = held[i, wheel, 1]
    status = settle(
        ground, linkage, samples, poses[i, 0], poses[i, 1], poses[i, 2],
        q, placement, touch, work.J, work.step,
    )  # fmt: skip
    if status == SETTLED:
        place_masses(linkage, q, placement)
        columns_needed = 1 if settings.policy == EQUAL else 1 + FREE_FORCES
        if not balance_forces(linkage, placement, touch, columns_needed, work.balance):
            status = NO_EQUILIBRIUM
    columns.status[i] = status
    if status != SETTLED:
        q[:] = np.nan
        return
    _write_geometry(placement, touch, i, columns)
    _write_forces(ground, linkage, settings, work, i, columns)
    angle, measure = find_tip_over(linkage, work)
    columns.tip_over_ratio[i] = angle / settings.flat_angle
    columns.force_angle[i] = measure / settings.flat_measure
    columns.clearance[i] = belly_clearance(ground, linkage, placement)


@kernel
def _write_geometry(placement, touch, i, columns):
    for wheel in range(6):
        columns.contact_angle[i, wheel] = np.arctan2(touch.sine[wheel], touch.cosine[wheel])
        for k in range(3):
            columns.centres[i, wheel, k] = placement.centres[wheel, k]
            columns.points[i, wheel, k] = touch.point[wheel, k]


@kernel
def _write_forces(ground, linkage, settings, work, i, columns):
    search, point = work.search, work.touch.point
    weight = linkage.mass * linkage.gravity
    for wheel in range(6):
        search.mu[wheel] = friction_at(ground, point[wheel, 0], point[wheel, 1], settings.friction)
    if settings.on_soil:
        share_forces_on_soil(ground, linkage, settings, work)
    elif settings.policy == EQUAL:
        take_equal_torques(work.balance, search)
    else:
        largest = settings.allowed_torque / (linkage.radius * weight)
        minimise_friction(work.balance, largest, search)
    power = 0.0
    for wheel in range(6):
        N, T, S = weight * search.N[wheel], weight * search.T[wheel], weight * search.S[wheel]
        mu = search.mu[wheel]
        sinkage, resistance = 0.0, 0.0
        if settings.on_soil:
            soil = settings.soils[work.soil_rows[wheel]]
            slip, sinkage, resistance, pull, torque, utilisation = solve_wheel(
                soil, mu, linkage.radius, linkage.width, N, settings.direction * T, S
            )
            torque *= settings.direction
            mu = effective_friction(soil, mu, linkage.radius, linkage.width, N)
        else:
            torque = linkage.radius * T
            utilisation = np.sqrt(T * T + S * S) / (mu * N) if N > 0.0 else np.inf
            slip = coulomb_slip(utilisation)
        columns.N[i, wheel] = N
        columns.T[i, wheel] = T
        columns.S[i, wheel] = S
        columns.torque[i, wheel] = torque
        columns.friction[i, wheel] = mu
        columns.utilisation[i, wheel] = utilisation
        columns.slip[i, wheel] = slip
        columns.saturation[i, wheel] = abs(torque) / settings.max_torque
        columns.sinkage[i, wheel] = sinkage
        columns.resistance[i, wheel] = resistance
        power += max(settings.direction * torque, 0.0) * _wheel_speed(
            linkage.radius, slip, settings
        )
    columns.power[i] = power


@kernel
def _wheel_speed(radius, slip, settings):
    if slip >= 1.0:
        return settings.max_wheel_speed
    return min(settings.speed / (radius * (1.0 - slip)), settings.max_wheel_speed)


@kernel
def find_tip_over(linkage, work):
    """Return tip-over angle [rad] and force-angle measure [N m] of a placed rover."""
    centre, force, moment = work.vectors[0], work.vectors[1], work.vectors[2]
    _write_centre_of_mass(linkage, work.placement, centre)
    force[0], force[1], force[2] = 0.0, 0.0, -linkage.mass * linkage.gravity
    moment[:] = 0.0
    if linkage.has_tool_load:
        _add_tool_load(linkage, work.placement, centre, force, moment)
    find_support(linkage, work.placement, work.touch, work.corners)
    return tip_over_angles(work.corners, centre, force, moment)


@kernel
def _add_tool_load(linkage, placement, centre, force, moment):
    """Add the tool's force and its moment about `centre`."""
    origin, tool = placement.origin, linkage.tool
    fx, moment_x = tool_load(placement.R, tool, np.int64(0))
    fy, moment_y = tool_load(placement.R, tool, np.int64(1))
    fz, moment_z = tool_load(placement.R, tool, np.int64(2))
    rx, ry, rz = origin[0] - centre[0], origin[1] - centre[1], origin[2] - centre[2]
    force[0] += fx
    force[1] += fy
    force[2] += fz
    moment[0] += moment_x + ry * fz - rz * fy
    moment[1] += moment_y + rz * fx - rx * fz
    moment[2] += moment_z + rx * fy - ry * fx


@kernel
def _write_centre_of_mass(linkage, placement, centre):
    coms, centres = placement.part_coms, placement.centres
    for k in range(3):
        total = linkage.body_mass * coms[0, k]
        total += linkage.rocker_mass * (coms[1, k] + coms[2, k])
        total += linkage.bogie_mass * (coms[3, k] + coms[4, k])
        for wheel in range(6):
            total += linkage.wheel_mass * centres[wheel, k]
        centre[k] = total / linkage.mass
