# SPDX-License-Identifier: Apache-2.0
"""Fallback if OSQP fails: all wheels get the same torque, and the answer is marked.

`TractionWorkspace.solve` reports a failure if OSQP's status is not "solved" or a variable is not
finite. If no program was solved before, `solve_traction` takes the forces of this file and marks
the answer with `fallback`. The traction controller counts such answers and reports them on
/diagnostics. Equal torques always keep the balance, so the rover drives on, but a wheel may slip
while others still have friction in reserve.
"""

import numpy as np

from rover_physics.traction.balance import BalanceRows


def fall_back_to_equal_torques(rows: BalanceRows) -> np.ndarray:
    """Return forces x (14,), in force units, that keep the balance with equal torques."""
    return rows.pull_equally()
