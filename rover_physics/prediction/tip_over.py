# SPDX-License-Identifier: Apache-2.0
"""Tip-over measures of a settled rover, from its centre of mass and the forces on it."""

import numpy as np

from rover_physics.forces.equilibrium import tool_load
from rover_physics.forces.stability import find_support, tip_over_angles
from rover_physics.numerics.kernels import kernel


@kernel
def find_tip_over(linkage, work):
    """Return tip-over angle [rad] and force-angle measure [N m] from placement and contacts."""
    centre, force, moment = work.centre, work.force, work.moment
    _write_centre_of_mass(linkage, work.placement, centre)
    force[0], force[1], force[2] = 0.0, 0.0, -linkage.mass * linkage.gravity
    moment[:] = 0.0
    if linkage.has_tool_load:
        _add_tool_load(linkage, work.placement, centre, force, moment)
    find_support(linkage, work.placement, work.contacts, work.corners)
    return tip_over_angles(work.corners, centre, force, moment)


@kernel
def _add_tool_load(linkage, placement, centre, force, moment):
    """Add the tool's force [N] and its moment [N m] about `centre` to `force` and `moment`."""
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
