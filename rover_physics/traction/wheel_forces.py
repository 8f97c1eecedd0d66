# SPDX-License-Identifier: Apache-2.0
"""The forces of an answer at each wheel, in SI units."""

import numpy as np

from rover_physics.names import WHEEL_COUNT
from rover_physics.numerics.kernels import kernel
from rover_physics.traction.layout import LATERAL_SHARE, LATERAL_SLOPE, LOAD, TRACTION

WHEEL_FORCES = ("torques", "loads", "tractions", "lateral", "utilisation")
"""Rows of a table of wheel forces."""


@kernel
def write_wheel_forces(balances, all_inputs, x, table):
    """Write forces x (14,), in force units, into a table of wheel forces.

    Args:
        balances: Array (1,) of MEASURED_BALANCE.
        all_inputs: Array (1,) of PROGRAM_INPUTS; torques are cut off at its largest.
        x: (14,) tractions, loads and lateral terms in force units.
        table: (5, 6) rows as in WHEEL_FORCES: torques [N m], loads, tractions and lateral forces
            [N], utilisations, infinite where there is no load.

    Returns:
        Largest utilisation, smallest load [N], largest size of a traction [N].
    """
    balance, inputs = balances[0], all_inputs[0]
    unit, limit = balance.force_unit, inputs.max_torque
    torques, loads, tractions = table[0], table[1], table[2]
    laterals, utilisation = table[3], table[4]
    peak, min_load, max_traction = 0.0, np.inf, 0.0
    for wheel in range(WHEEL_COUNT):
        traction, load = unit * x[TRACTION + wheel], unit * x[LOAD + wheel]
        shares = balance.lateral_shares[wheel]
        lateral = unit * (x[LATERAL_SHARE] * shares[0] + x[LATERAL_SLOPE] * shares[1])
        across = np.sqrt(traction * traction + lateral * lateral)
        used = across / (inputs.friction[wheel] * load) if load > 0.0 else np.inf
        torques[wheel] = min(max(inputs.radius * traction, -limit), limit)
        loads[wheel], tractions[wheel], laterals[wheel] = load, traction, lateral
        utilisation[wheel] = used
        peak, min_load = max(peak, used), min(min_load, load)
        max_traction = max(max_traction, abs(traction))
    return peak, min_load, max_traction
