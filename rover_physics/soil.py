"""Wheel-soil models: the slip ratio a wheel needs to pull as the equilibrium asks."""

from rover_physics.kernels import kernel


@kernel
def coulomb_slip(utilisation):
    """Return the slip ratio i = 1 - v / (r omega) on Coulomb ground.

    A wheel sticks below the friction limit and spins freely above it: 0 or 1.
    """
    return 0.0 if utilisation <= 1.0 else 1.0
