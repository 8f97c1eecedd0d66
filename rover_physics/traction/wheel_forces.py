"""The forces of an answer at each wheel, in SI units."""

import numpy as np

from rover_physics.names import WHEEL_COUNT
from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.records import record_type
from rover_physics.traction.layout import LATERAL_SHARE, LATERAL_SLOPE, LOAD, TRACTION

WHEEL_FORCES = record_type(
    ("torques", float, (WHEEL_COUNT,)),  # [N m], within the limit
    ("loads", float, (WHEEL_COUNT,)),  # [N]
    ("tractions", float, (WHEEL_COUNT,)),  # [N]
    ("lateral", float, (WHEEL_COUNT,)),  # lateral forces [N]
    ("utilisation", float, (WHEEL_COUNT,)),  # infinite where there is no load
)
"""Torques and forces of the six wheels."""


@kernel
def write_wheel_forces(balances, all_limits, x, found):
    """Write forces x (14,), in force units, into a record WHEEL_FORCES.

    Args:
        balances: Array (1,) of MEASURED_BALANCE.
        all_limits: Array (1,) of WHEEL_LIMITS; torques are cut off at its largest.
        x: (14,) tractions, loads and lateral terms in force units.
        found: Array (1,) of WHEEL_FORCES.

    Returns:
        Largest utilisation, smallest load [N], largest size of a traction [N].
    """
    balance, limits, forces = balances[0], all_limits[0], found[0]
    unit, limit = balance.force_unit, limits.max_torque
    peak, min_load, max_traction = 0.0, np.inf, 0.0
    for wheel in range(WHEEL_COUNT):
        traction, load = unit * x[TRACTION + wheel], unit * x[LOAD + wheel]
        lateral = unit * (x[LATERAL_SHARE] + x[LATERAL_SLOPE] * balance.along[wheel])
        across = np.sqrt(traction * traction + lateral * lateral)
        used = across / (limits.friction[wheel] * load) if load > 0.0 else np.inf
        forces.torques[wheel] = min(max(limits.radius * traction, -limit), limit)
        forces.loads[wheel], forces.tractions[wheel] = load, traction
        forces.lateral[wheel], forces.utilisation[wheel] = lateral, used
        peak, min_load = max(peak, used), min(min_load, load)
        max_traction = max(max_traction, abs(traction))
    return peak, min_load, max_traction
