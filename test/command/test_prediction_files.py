# SPDX-License-Identifier: Apache-2.0
"""Files of `predict` that hold something else are refused by name."""

import numpy as np
import pytest

from rover_physics.rover.rover_file import load_rover
from rover_physics.traversability.judge import judge_path
from rover_planner.command.prediction_files import (
    read_prediction,
    read_recorded_assumptions,
    write_prediction,
)
from rover_planner.errors import PlanningError
from rover_planner.planning.assumptions import read_assumptions
from support.grounds import make_terrain, wall_at

LSR1, X = load_rover("lsr1"), np.linspace(-1.0, 1.0, 101)
PATH = np.column_stack([X, np.zeros_like(X), np.zeros_like(X)])


def test_a_file_without_predictions_is_refused_by_name(tmp_path):
    np.savez(tmp_path / "poses.npz", poses=PATH)
    with pytest.raises(PlanningError, match=r"no array reason; it has poses"):
        read_prediction(tmp_path / "poses.npz")


@pytest.mark.parametrize(
    ("changes", "names"),
    [
        ({"assumptions": np.float64(1.0)}, "assumptions is of type float64; it must hold texts"),
        ({"roll": np.float64(1.0)}, r"roll has shape \(\); it must be \(101,\)"),
        ({"settled": np.zeros(101)}, "settled is of type float64; it must hold bools"),
        ({"reason": np.zeros(101)}, "reason is of type float64; it must hold texts"),
        ({"position": np.full((101, 3), np.nan)}, "position has a value that is NaN or beyond"),
    ],
)
def test_a_file_of_other_shapes_or_types_is_refused(tmp_path, changes, names):
    prediction, verdict = judge_path(LSR1, make_terrain(wall_at(0.5)), PATH)
    write_prediction(tmp_path / "out.npz", prediction, verdict)
    with np.load(tmp_path / "out.npz") as out:
        np.savez(tmp_path / "bad.npz", **(dict(out) | changes))
    with pytest.raises(PlanningError, match=names):
        read_recorded_assumptions(tmp_path / "bad.npz")
        read_prediction(tmp_path / "bad.npz")


@pytest.mark.parametrize(
    "text",
    ["", '{"rover": "lsr1"}', '{"rover": "lsr1", "policy": "equal", "friction": NaN}',
     '{"rover": "lsr1", "policy": "equal", "colour": "red"}'],
)  # fmt: skip
def test_damaged_assumptions_are_refused(text):
    with pytest.raises(PlanningError, match="assumptions are invalid"):
        read_assumptions(text)
