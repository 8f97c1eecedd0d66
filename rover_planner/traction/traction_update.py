# SPDX-License-Identifier: Apache-2.0
"""The result of one update of the traction controller."""

from dataclasses import dataclass

from rover_physics.numerics.arrays import Floats
from rover_physics.traction.contact_ekf import ContactEstimate
from rover_physics.traction.solver import TractionAnswer


@dataclass(frozen=True, eq=False)
class TractionUpdate:
    """The result of one update."""

    torques: Floats
    """(6,) torques to command, wheel order [N m]; zero if there is a fault."""
    fault: str
    """Reason for zero torques; empty if there is no fault."""
    warning: str
    """Problem that does not stop the rover; empty if there is none."""
    answer: TractionAnswer | None
    """The torque allocation, before heading and slip control; None if there is a fault."""
    estimate: ContactEstimate | None
    """The contact angles; None if there is a fault."""
    duration: float
    """Computation time of the update [s]."""
