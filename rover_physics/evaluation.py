"""The full model at one pose, and the compiled sweep of it over many poses."""

from typing import NamedTuple

import numpy as np
from numba import prange

from rover_physics.clearance import belly_clearance
from rover_physics.contact import Touch, new_touch
from rover_physics.equilibrium import FREE_FORCES, Balance, balance_forces, new_balance
from rover_physics.ground import friction_at
from rover_physics.kernels import allocating_kernel, kernel, sweep_kernel
from rover_physics.linkage import Placement, new_placement, place_masses
from rover_physics.settling import SETTLED, settle
from rover_physics.soil import coulomb_slip
from rover_physics.stability import CORNERS, find_support, tip_over_angles
from rover_physics.torques import (
    TorqueSearch,
    minimise_friction,
    new_torque_search,
)

NO_EQUILIBRIUM = 4
EQUAL, OPTIMAL = 0, 1
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


def new_columns(n: int) -> Columns:
    """Return results of n poses, all NaN."""

    def blank(*shape: int) -> np.ndarray:
        return np.full((n, *shape), np.nan)

    per_wheel = [blank(6) for _ in range(9)]
    per_pose = [blank() for _ in range(4)]
    return Columns(np.zeros(n, np.int8), blank(6), blank(6, 3), blank(6, 3), *per_wheel, *per_pose)


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
    if settings.policy == EQUAL:
        for wheel in range(6):
            search.N[wheel] = work.balance.normal[wheel, 0]
            search.T[wheel] = work.balance.tangential[wheel, 0]
            search.S[wheel] = work.balance.lateral[wheel, 0]
    else:
        minimise_friction(work.balance, settings.max_torque / (linkage.radius * weight), search)
    power = 0.0
    for wheel in range(6):
        N, T, S = weight * search.N[wheel], weight * search.T[wheel], weight * search.S[wheel]
        mu = search.mu[wheel]
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
        power += max(torque, 0.0) * _wheel_speed(linkage.radius, slip, settings)
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
    find_support(linkage, work.placement, work.touch, work.corners)
    return tip_over_angles(work.corners, centre, force, moment)


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
