# SPDX-License-Identifier: Apache-2.0
"""The board: the wheels and the numbers of the rover at one time."""

import math
from typing import Any

from rover_physics.names import WHEELS
from rover_planner.viewer.documents.numbers import plain, write
from rover_planner.viewer.state.colours import colour_use, to_css
from rover_planner.viewer.state.path_limits import write_use
from rover_planner.viewer.state.rover_state import RoverState

WHEEL_ROWS = {
    "normal force N [N]": ("wheel_loads", 1.0, 1),
    "traction T [N]": ("tangential", 1.0, 1),
    "lateral force S [N]": ("lateral", 1.0, 1),
    "use of friction [%]": ("friction_use", 100.0, 0),
    "use of torque [%]": ("torque_use", 100.0, 0),
    "slip ratio [%]": ("slip_ratio", 100.0, 0),
}
"""Rows of the table of wheels: field of the state, factor and digits."""


def describe_board(
    state: RoverState | None, failing: str = "", *, has_slip: bool = False
) -> dict[str, Any] | None:
    """Return the wheels in wheel order, and the numbers of a state; None without a state.

    Args:
        state: The rover.
        failing: The link that fails, empty for none.
        has_slip: True if slip is predicted, on yielding soil or with speed servos.
    """
    if state is None:
        return None
    wheels = []
    for k, name in enumerate(WHEELS):
        friction, torque = float(state.friction_use[k]), float(state.torque_use[k])
        bars = (("friction", friction), ("torque", torque))
        slip = abs(float(state.slip_ratio[k]))
        wheels.append(
            {
                "name": name.replace("_", " "),
                "bars": [[title, plain(use), write_use(use)] for title, use in bars],
                "colour": to_css(colour_use(friction)),
                "load": write(float(state.wheel_loads[k]), 1, "N"),
                "slip": write(100.0 * slip, 0, "% slip") if has_slip else "",
                "turn": plain(math.degrees(float(state.steering_angle[k])), 1),
                "fails": failing == name,
            }
        )
    numbers = {
        "time": write(state.time, 1, "s"),
        "distance": write(100.0 * state.distance, 1, "cm"),
        "speed": write(100.0 * state.speed, 1, "cm/s"),
        "energy": write(state.energy, 2, "J"),
        "tilt": write(math.degrees(state.tilt), 1, "deg"),
        "belly": write(100.0 * state.belly_clearance, 1, "cm"),
        "margin": write(state.tip_over_ratio, 2),
        "x, y": f"{state.position[0]:.2f}, {state.position[1]:.2f} m",
    }
    table = [
        [title, [write(scale * float(value), digits) for value in getattr(state, name)]]
        for title, (name, scale, digits) in WHEEL_ROWS.items()
    ]
    return {"wheels": wheels, "numbers": numbers, "table": table}
