# SPDX-License-Identifier: Apache-2.0
"""The one record of what is predicted at a pose: a new quantity is one row of QUANTITIES.

`prediction.evaluation` computes it, under policy "servo" `forces.servo`.
"""

from typing import Any, NamedTuple

import numpy as np

from rover_physics.numerics.records import record_type
from rover_physics.status import PoseStatus


class Quantity(NamedTuple):
    """One predicted quantity of a pose."""

    name: str
    """Name in a RESULT, in `PathPrediction` and in files."""
    shape: tuple[int, ...]
    """Shape at one pose; (6,) is a value of each wheel in the order of WHEELS."""
    unit: str
    """SI unit, empty for ratios."""
    meaning: str
    """Meaning, frame and signs."""
    is_kept: bool = True
    """True if files keep it; else it follows from the others."""
    of_path: bool = False
    """True if the path around the pose decides it; 0 at a pose that is on no path."""
    of_motion: bool = False
    """True if it is also known where the rover does not settle."""


QUANTITIES = (
    Quantity(
        "q", (6,), "m, rad",
        "z of the body origin, roll, pitch, right rocker angle, right and left bogie angle", False,
    ),
    Quantity("tilt", (), "rad", "angle between the body's z axis and the vertical", False),
    Quantity("rocker_angle", (2,), "rad", "rocker angles relative to the body, right and left"),
    Quantity("wheel_centres", (6, 3), "m", "wheel centres, map frame"),
    Quantity("contact_points", (6, 3), "m", "contact points of the wheels, map frame"),
    Quantity(
        "contact_angle", (6,), "rad",
        "angle from the lowest point of the wheel to the contact, positive in front",
    ),
    Quantity("wheel_loads", (6,), "N", "normal forces N on the wheels"),
    Quantity("tangential", (6,), "N", "tractions T along the wheels' headings"),
    Quantity(
        "lateral", (6,), "N", "lateral forces S along the wheels' axes, positive to the left"
    ),
    Quantity("torque", (6,), "N m", "motor torques, positive forward"),
    Quantity(
        "friction", (6,), "",
        "friction coefficient mu at the contact; on yielding soil: the largest drawbar pull over "
        "the wheel load",
    ),
    Quantity(
        "friction_utilisation", (6,), "",
        "sqrt(T^2 + S^2) / (mu N), the paper's S_r; infinite for a wheel that lifts off, 0 for "
        'one under policy "servo". On yielding soil: (T, S) relative to the largest forces in '
        "their direction",
    ),
    Quantity(
        "slip_ratio", (6,), "",
        "i = 1 - v / (r omega), from the soil model or from the servos; of a wheel that these "
        "brake on firm ground (r omega) / v - 1",
    ),
    Quantity("torque_saturation", (6,), "", "|torque| / largest torque"),
    Quantity("sinkage", (6,), "m", "sinkage of the wheels in yielding soil"),
    Quantity(
        "motion_resistance", (6,), "N",
        "motion resistance of the soil; the torque overcomes it besides the traction",
    ),
    Quantity(
        "tip_over_ratio", (), "",
        "smallest tip-over angle over that on flat ground (the paper's stability margin)",
    ),
    Quantity(
        "tip_over_force_angle", (), "",
        "force-angle measure (Papadopoulos and Rey) over that on flat ground",
    ),
    Quantity("belly_clearance", (), "m", "smallest height of the underside above the ground"),
    Quantity(
        "power", (), "W",
        "mechanical power of the wheel motors at the nominal speed; braking motors count as 0",
    ),
    Quantity(
        "speed_share", (), "",
        "share of the commanded motion that the rover makes: 0 where no forward speed balances; "
        'under other policies than "servo" 1, and 0 where a wheel is wedged',
    ),
    Quantity("stalls", (), "", "why the rover stands, a Stall"),
    Quantity(
        "deficit", (), "",
        "force along the motion that is missing where no forward speed balances, over the weight; "
        "negative where it is missing to brake, infinite where none helps", False,
    ),
    Quantity(
        "friction_share", (), "",
        'share of the friction of all wheels that policy "servo" uses; 0 under the others', False,
    ),
    Quantity(
        "torque_share", (), "",
        'mean torque saturation of the wheels under policy "servo"; 0 under the others', False,
    ),
    Quantity(
        "kept_share", (), "",
        "share of the limits of friction and torque that counts: less the control margin where "
        "optimal torques are needed, else 1", False,
    ),
    Quantity(
        "deviation", (3,), "rad/m",
        'motion beyond the share of the commanded one under policy "servo": forward and to the '
        "left, over the nominal speed, and turning left, per metre of nominal path",
    ),
    Quantity(
        "lift_rate", (6,), "",
        'speed at which wheels lift off the ground under policy "servo", over the nominal speed',
    ),
    Quantity(
        "slip_speed", (6,), "m/s",
        'speed at which the treads slide over the ground under policy "servo"',
    ),
    Quantity(
        "motion", (3,), "m/s, rad/s",
        "nominal motion of the body origin on the path to the pose, body frame: vx, vy and yaw "
        "rate; that of the first waypoint leads on from there", of_motion=True,
    ),
    Quantity(
        "steering_angle", (6,), "rad",
        "angles of the wheels about the z axes of their links, positive to the left; where the "
        "status is STEERING, what the motion asks for", of_motion=True,
    ),
    Quantity(
        "wheel_speed", (6,), "rad/s",
        "nominal rates of the wheels, without slip, negative where they roll back", of_motion=True,
    ),
    Quantity(
        "wheel_drop", (6,), "m",
        "height that a wheel dropped off an edge, here or on the way here", of_path=True,
    ),
    Quantity(
        "falling", (6,), "", "1 for wheels that roll off an edge here: they need no equilibrium",
        of_path=True,
    ),
    Quantity(
        "lift_height", (6,), "m", 'height to which wheels have lifted under policy "servo"',
        of_path=True,
    ),
    Quantity(
        "drift", (2,), "rad, m",
        'turn and slide off the path that build up within the last wheelbase under policy "servo"',
        of_path=True,
    ),
    Quantity("distance", (), "m", "horizontal distance since the first waypoint", of_path=True),
    Quantity(
        "time", (), "s",
        'time since the first waypoint at nominal speed, under policy "servo" at the share of it '
        "that is made. Where wheels take longer to turn than the drive from a waypoint to the "
        "next, the drive waits for them", of_path=True,
    ),
    Quantity(
        "energy", (), "J",
        "mechanical energy of the wheels that drive since the first waypoint; steps from or to "
        "poses that are not settled count as 0", of_path=True,
    ),
)  # fmt: skip
"""All quantities of a pose besides its status; NaN where the rover does not settle, but for some
of motion and path."""

RESULT = record_type(("status", np.int8), *((one.name, float, one.shape) for one in QUANTITIES))
"""Results at one pose: its PoseStatus and the QUANTITIES."""
RESULT_COLUMNS = RESULT.itemsize // 8
"""Columns of RESULTs as numbers; the first holds the status."""
VIEWS = {
    "roll": ("q", 1, ()),
    "pitch": ("q", 2, ()),
    "bogie_angle": ("q", 4, (2,)),
    "turn_off": ("drift", 0, ()),
    "slide_off": ("drift", 1, ()),
}
"""Names of parts of a quantity: the quantity, the first of its numbers, and the part's shape."""


def find_column(name: str) -> tuple[int, int]:
    """Return the first column of a quantity or view in `numbers_of`, and how many it has.

    Raises:
        KeyError: There is no such quantity.
    """
    whole, first, shape = VIEWS.get(name, (name, 0, None))
    kind, offset = RESULT[whole], RESULT.fields[whole][1]  # type: ignore[index]
    return offset // 8 + first, int(np.prod(kind.shape if shape is None else shape))


def unwritten_results(n: int) -> Any:
    """Return RESULTs (n,) of any content: the system provides their memory when it is written."""
    return np.empty((n, RESULT_COLUMNS)).view(RESULT)[:, 0]


def new_results(n: int) -> Any:
    """Return RESULTs (n,), all NaN with status 0."""
    results = unwritten_results(n)
    clear_results(results)
    return results


def clear_results(results: Any) -> None:
    """Make RESULTs (n,) NaN with status 0."""
    results.view(np.float64).fill(np.nan)
    results["status"] = 0


def numbers_of(results: Any) -> np.ndarray:
    """Return RESULTs as floats (n, RESULT_COLUMNS), which numpy copies faster than records."""
    return results.view(np.float64).reshape(len(results), RESULT_COLUMNS)


def select_results(results: Any, rows: Any) -> Any:
    """Return a copy of the RESULTs at row indices, or where a mask is True."""
    return numbers_of(results)[rows].view(RESULT)[:, 0]


def place_results(results: Any, to: Any, rows: Any) -> None:
    """Copy RESULTs (k,) into rows (k,) of others."""
    numbers_of(to)[rows] = numbers_of(results)


def join_results(parts: Any) -> Any:
    """Return the RESULTs of all parts, one after the other."""
    return np.concatenate([numbers_of(part) for part in parts]).view(RESULT)[:, 0]


def forget_uncomputable(results: Any) -> None:
    """Overwrite by NaN what is not of motion or path where the forces are not determined."""
    status = results["status"]
    no_forces = status == PoseStatus.NOT_COMPUTABLE
    rows = np.flatnonzero(no_forces | (status == PoseStatus.NO_EQUILIBRIUM))
    if len(rows):
        for one in QUANTITIES:
            if not (one.of_motion or one.of_path):
                results[one.name][rows] = np.nan
