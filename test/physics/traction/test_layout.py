"""Names of variables and rows: each row of a program holds the variables that its name says."""

from itertools import pairwise

import numpy as np
import pytest

from rover_physics.names import WHEEL_COUNT
from rover_physics.rover.rover_file import load_rover
from rover_physics.traction import layout
from rover_physics.traction.balance import BalanceWriter, MeasuredState
from rover_physics.traction.program import Reference, build_traction_qp
from rover_physics.traction.program_inputs import ProgramInputs

LSR1 = load_rover("lsr1")
INPUTS = ProgramInputs(np.full(6, 0.7), LSR1.wheel.max_torque, LSR1.wheel.radius)


@pytest.fixture(scope="module")
def program():
    state = MeasuredState(0.1, -0.2, 0.05, np.array([0.1, -0.1]), np.linspace(-0.3, 0.3, 6))
    rows = BalanceWriter(LSR1).write(state, 4.0)
    x = rows.complete(np.linspace(-0.1, 0.1, 6))
    return build_traction_qp(rows, INPUTS, Reference(x, 0.4))


def variables_of(program, row):
    return set(np.flatnonzero(program.A[row]))


def test_blocks_of_rows_follow_one_another_without_gaps():
    starts = (
        layout.BALANCE_ROWS,
        layout.CONE_ROWS,
        layout.PEAK_LIMIT_ROW,
        layout.LOAD_ROWS,
        layout.FORWARD_PULL_ROWS,
        layout.BACKWARD_PULL_ROWS,
        layout.SIGN_ROWS,
        layout.ROWS,
    )
    sizes = [end - start for start, end in pairwise(starts)]
    assert sizes == [layout.EQUATIONS, WHEEL_COUNT * layout.CONE_SIDES, 1, *[WHEEL_COUNT] * 3, 4]


def test_equations_hold_equally_and_determine_the_variables_in_their_order(program):
    for equation in range(layout.EQUATIONS):
        row = layout.BALANCE_ROWS + equation
        assert program.lower[row] == program.upper[row]
        determined = program.A[row, layout.LOAD : layout.FORCES]
        assert np.flatnonzero(determined).tolist() == (
            [equation] if equation < layout.TRACTION_EQUATION else []
        )


@pytest.mark.parametrize("wheel", range(WHEEL_COUNT))
def test_rows_of_a_wheel_hold_its_own_variables(program, wheel):
    traction, load = layout.TRACTION + wheel, layout.LOAD + wheel
    first = layout.CONE_ROWS + wheel * layout.CONE_SIDES
    for row in range(first, first + layout.CONE_SIDES):
        allowed = {traction, load, layout.LATERAL_SHARE, layout.LATERAL_SLOPE, layout.PEAK}
        assert {load, layout.PEAK} < variables_of(program, row) <= allowed
    assert variables_of(program, layout.LOAD_ROWS + wheel) == {load, layout.LOAD_SLACK}
    for rows in (layout.FORWARD_PULL_ROWS, layout.BACKWARD_PULL_ROWS):
        assert variables_of(program, rows + wheel) == {traction, layout.TORQUE_SLACK}


def test_the_peak_has_a_limit_and_peak_and_slacks_a_sign(program):
    peak, slack = layout.PEAK, layout.FRICTION_SLACK
    assert variables_of(program, layout.PEAK_LIMIT_ROW) == {peak, slack}
    signed = [variables_of(program, row) for row in range(layout.SIGN_ROWS, layout.ROWS)]
    assert signed == [{peak}, {slack}, {layout.LOAD_SLACK}, {layout.TORQUE_SLACK}]
