"""Linear systems are solved with pivoting; the solvers of one size do the same to the bit."""

import numpy as np
import pytest

from rover_physics.numerics.linear_solve import solve_in_place, solve_nine, solve_six

SOLVERS = {6: solve_six, 9: solve_nine}


def systems(n):
    """Yield matrices (n, n) and right-hand sides (n, 1): full, sparse, with zero pivots."""
    rng = np.random.default_rng(n)
    for k in range(200):
        A = rng.standard_normal((n, n))
        if k % 2:
            A *= rng.random((n, n)) < 0.5
        if k % 3 == 0:
            A[np.diag_indices(n)] = 0.0
        yield A, rng.standard_normal((n, 1))


@pytest.mark.parametrize("n", SOLVERS)
def test_the_solver_of_one_size_equals_the_general_one_to_the_bit(n):
    solved = 0
    for A, b in systems(n):
        one, other = (A.copy(), b.copy()), (A.copy(), b.copy())
        found = SOLVERS[n](*one)
        assert found == solve_in_place(*other, n, 1)
        np.testing.assert_array_equal(one[0], other[0])
        np.testing.assert_array_equal(one[1], other[1])
        if found:
            solved += 1
            np.testing.assert_allclose(A @ one[1], b, atol=1e-9 * np.linalg.cond(A))
    assert solved > 150


@pytest.mark.parametrize("n", SOLVERS)
def test_singular_systems_are_refused(n):
    A = np.ones((n, n))
    assert not SOLVERS[n](A.copy(), np.ones((n, 1)))
    assert not SOLVERS[n](np.zeros((n, n)), np.ones((n, 1)))
    A = np.full((n, n), np.nan)
    assert not SOLVERS[n](A, np.ones((n, 1)))
