"""What happens when OSQP fails: all wheels get the same torque, and the answer says so.

`TractionWorkspace.solve` reports a failure: OSQP's status is not "solved", or a variable is not
finite. `solve_traction` then takes the forces of this file where no program was solved before, and
marks the answer with `fallback`. A traction controller counts such answers and warns of them on
/diagnostics. Equal torques always keep the balance, so the rover drives on, but a wheel may slip
before the others have given their part.
"""

import numpy as np

from rover_physics.traction.balance import BalanceRows


def fall_back_to_equal_torques(rows: BalanceRows) -> np.ndarray:
    """Return forces x (14,), in force units, that keep the balance with equal torques."""
    return rows.pull_equally()
