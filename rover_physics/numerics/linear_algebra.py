# SPDX-License-Identifier: Apache-2.0
"""Vectors in space and small dense linear systems, for kernels.

Vectors are tuples (x, y, z) or arrays (3,); products that are vectors are tuples.
"""

from rover_physics.numerics.kernels import kernel


@kernel
def solve_in_place(A, B, n, m):
    """Solve A X = B by Gaussian elimination with partial pivoting, overwriting both.

    A (n, n) and B (n, m) are the upper left parts of the arrays; on return B holds X. Returns
    False if no pivot of A is above 1e-12; A should be scaled to order 1.
    """
    for k in range(n):
        pivot = k
        largest = abs(A[k, k])
        for i in range(k + 1, n):
            if abs(A[i, k]) > largest:
                largest = abs(A[i, k])
                pivot = i
        if not largest > 1e-12:
            return False
        if pivot != k:
            for j in range(k, n):
                A[k, j], A[pivot, j] = A[pivot, j], A[k, j]
            for j in range(m):
                B[k, j], B[pivot, j] = B[pivot, j], B[k, j]
        for i in range(k + 1, n):
            factor = A[i, k] / A[k, k]
            if factor != 0.0:
                for j in range(k + 1, n):
                    A[i, j] -= factor * A[k, j]
                for j in range(m):
                    B[i, j] -= factor * B[k, j]
    for j in range(m):
        for i in range(n - 1, -1, -1):
            total = B[i, j]
            for k in range(i + 1, n):
                total -= A[i, k] * B[k, j]
            B[i, j] = total / A[i, i]
    return True


@kernel
def difference(point, origin):
    """Return the vector to a point from an origin."""
    return point[0] - origin[0], point[1] - origin[1], point[2] - origin[2]


@kernel
def dot(a, b):
    """Return the scalar product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def cross(a, b):
    """Return the vector product of two vectors."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
