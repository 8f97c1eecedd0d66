# SPDX-License-Identifier: Apache-2.0
"""Figure 4 of the paper: loads against one torque, by the paper's equations and the model's."""

import numpy as np
import pytest

pytest.importorskip("matplotlib", reason="needs matplotlib")

from rover_physics import judge_path
from rover_planner.cli import main
from rover_planner.figures.figure4 import HELD, load_changes, loads_under_torque
from support.grounds import plane
from support.rover_geometry import balance_matrix, turned_round
from support.rovers import LSR1, M2020


@pytest.mark.parametrize("rover", [LSR1, turned_round(M2020)], ids=lambda rover: rover.name)
@pytest.mark.parametrize("axle", [0, 1, 2])
def test_loads_held_by_all_wheels_are_those_of_the_full_balance(rover, axle):
    prediction = judge_path(rover, plane(0.0, 0.0, half=4.0), [[0.0, 0.0, 0.0]])[0]
    A, b, _ = balance_matrix(rover, prediction, 0)
    tractions = np.zeros(3)
    tractions[axle] = 0.2 / rover.wheel.radius
    tractions -= tractions.mean()
    pulls = np.tile(tractions, 2) / rover.weight
    loads = np.linalg.lstsq(A[:, [*range(6), 12, 13]], b - A[:, 6:12] @ pulls, rcond=None)[0]
    expected = rover.weight * loads[:6].reshape(2, 3)
    assert expected[0] == pytest.approx(expected[1], rel=1e-9)
    assert loads_under_torque(rover, axle, 0.2, HELD) == pytest.approx(expected[0], rel=1e-6)


def test_alone_the_thrust_turns_the_rover_about_its_rocker_pivots():
    wheels, height = LSR1.suspension.wheels, 0.3
    for axle in range(3):
        changes = load_changes(LSR1, np.eye(3)[axle])
        arms = [wheels[name][0] for name in ("rear", "middle", "front")]
        assert changes @ arms == pytest.approx(-height, rel=1e-9)


def test_the_command_draws_a_picture_of_nine_panels(tmp_path, monkeypatch):
    from matplotlib.figure import Figure

    drawn = []
    monkeypatch.setattr(Figure, "savefig", lambda self, *_, **__: drawn.append(self))
    assert main(["figure4", str(tmp_path / "loads.png")]) == 0
    labels = [f"{name} wheel torque [mN·m]" for name in ("rear", "middle", "front")]
    assert sorted(axes.get_xlabel() for axes in drawn[0].axes) == sorted(3 * labels)
    for axes in drawn[0].axes:
        assert axes.get_lines()[1].get_xdata() == pytest.approx([-200.0, 200.0])
