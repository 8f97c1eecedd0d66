# SPDX-License-Identifier: Apache-2.0
"""Figure 4 of the paper: how the torque of one wheel changes the loads of all three of a side.

The rover stands on level ground and the same torque acts on one wheel of both sides. The loads
depend on the force that balances the thrust of that wheel. Two cases are drawn:

- alone: the other motors give no torque, as in the paper's model. The thrust is balanced at the
  rocker pivots, like the inertial force of the body of a rover that starts to move.
- held by all wheels: each wheel balances a third of the thrust, so that the rover stays at rest.
  This corresponds to the common traction in the balance of `rover_physics`.
"""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from rover_physics.names import WHEEL_POSITIONS
from rover_physics.rover.model import Rover
from rover_planner.figures.pictures import drawing
from rover_planner.studies.objectives import level_loads

MAX_TORQUE = 0.2
"""Torques vary between minus and plus MAX_TORQUE [N m], as in the paper."""
ALONE, HELD = "other motors off, thrust held at the body", "thrust held by all wheels alike"

_COLOURS = {ALONE: "#0072B2", HELD: "#D55E00"}
_DASHES = {ALONE: "-", HELD: (0, (4, 2))}
_HEADROOM = 1.55
"""Height of the load axis above its centre over that below: leaves room for labels."""


def loads_at_rest(rover: Rover) -> np.ndarray:
    """Return the loads (3,) [N] of rear, middle and front wheel of one side on level ground."""
    loads = level_loads(rover)
    return 0.5 * (loads[:3] + loads[3:])


def load_changes(rover: Rover, tractions: np.ndarray) -> np.ndarray:
    """Return the change of the loads (3,) [N] of a side on level ground due to tractions.

    The same tractions act on both sides. Source: eqs (13) to (15) of the paper with constant
    forces of the body; the net thrust, which remains in (12), acts at the rocker pivots. Order:
    rear, middle, front.

    Args:
        rover: The rover.
        tractions: (3,) tractions of the wheels of one side, positive forward [N].
    """
    suspension = rover.suspension
    wheels = np.array([suspension.wheels[name] for name in WHEEL_POSITIONS])
    on_bogie = np.array([name != suspension.rocker_wheel for name in WHEEL_POSITIONS])
    ground = wheels[:, 2] - rover.wheel.radius
    rocker, bogie = np.array(suspension.rocker_pivot), np.array(suspension.bogie_pivot)
    about_rocker = np.sum((ground - rocker[2]) * tractions)
    about_bogie = np.sum(on_bogie * (ground - bogie[2]) * tractions)
    equations = np.array(
        [np.ones(3), wheels[:, 0] - rocker[0], on_bogie * (wheels[:, 0] - bogie[0])]
    )
    return np.linalg.solve(equations, [0.0, about_rocker, about_bogie])


def loads_under_torque(rover: Rover, axle: int, torque: float, case: str) -> np.ndarray:
    """Return the loads (3,) [N] of a side with `torque` [N m] on the wheels of one axle.

    Args:
        rover: The rover.
        axle: Index into WHEEL_POSITIONS.
        torque: Torque on each of the two wheels, positive forward [N m].
        case: ALONE or HELD.
    """
    tractions = np.zeros(3)
    tractions[axle] = torque / rover.wheel.radius
    if case == HELD:
        tractions -= tractions.mean()
    return loads_at_rest(rover) + load_changes(rover, tractions)


def draw_figure4(path: Path, rover: Rover) -> None:
    """Write Figure 4 of the paper for `rover` as a picture of nine panels.

    Args:
        path: Picture to write; its suffix sets the format, such as .png.
        rover: The rover.

    Raises:
        PlanningError: The file cannot be written.
    """
    torques = np.array([-MAX_TORQUE, MAX_TORQUE])
    loads = {
        (row, case): np.array([loads_under_torque(rover, row, t, case) for t in torques])
        for row in range(3)
        for case in (ALONE, HELD)
    }
    centre = loads_at_rest(rover)
    largest = 1.15 * max(np.abs(values - centre).max() for values in loads.values())
    with drawing(path, (10.5, 9.0)) as figure:
        panels = figure.subplots(3, 3, sharex=True, sharey="col")
        for row in range(3):
            for column in range(3):
                axes = panels[row, column]
                for case in (ALONE, HELD):
                    _draw_line(axes, torques, loads[row, case][:, column], case)
                axes.axhline(
                    centre[column], color="#999999", linewidth=0.8, zorder=1.9, label="no torque"
                )
                axes.set_ylim(centre[column] - largest, centre[column] + _HEADROOM * largest)
                axes.set_xlabel(f"{WHEEL_POSITIONS[row]} wheel torque [mN·m]")
                axes.set_ylabel(f"{WHEEL_POSITIONS[column]} load [N]")
        for column in range(3):
            title = f"{WHEEL_POSITIONS[column].capitalize()} normal force"
            panels[0, column].set_title(title, fontsize=11, fontweight="bold")
        panels[0, 0].set_xticks([-200, -100, 0, 100, 200])
        figure.suptitle(
            f"Over-actuation of {rover.name} on level ground: wheel loads against one torque",
            fontsize=13,
            fontweight="bold",
        )
        handles, labels = panels[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3)


def _draw_line(axes: Axes, torques: np.ndarray, loads: np.ndarray, case: str) -> None:
    """Draw one line and label it with its slope per 100 mN m."""
    axes.plot(
        1e3 * torques, loads, color=_COLOURS[case], linestyle=_DASHES[case], linewidth=1.8,
        label=case,
    )  # fmt: skip
    slope = 0.1 * np.diff(loads)[0] / np.diff(torques)[0]
    words = f"{slope:+.2f} N per 100 mN·m".replace("-", "\N{MINUS SIGN}")
    axes.text(
        0.03, 0.98 if case == ALONE else 0.90, words, transform=axes.transAxes, va="top",
        color=_COLOURS[case], fontsize=8.5,
        bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.0},
    )  # fmt: skip
