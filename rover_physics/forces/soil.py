# SPDX-License-Identifier: Apache-2.0
"""Wheel-soil models: slip, sinkage and torque of a wheel for given forces on a soil.

There are two models: Coulomb friction, and for a rigid wheel Bekker's pressure-sinkage relation
with Janosi and Hanamoto's shear relation. docs/soil.md has the formulas, symbols and limits.

Source: Wong, Theory of Ground Vehicles, 4th ed., Wiley 2008, chapter 2.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rover_physics.numerics.kernels import kernel
from rover_physics.terrain.ground import SOIL_NUMBERS
from rover_physics.terrain.soil_file import COULOMB_MODEL, Soil, soil_named

SOIL_MODEL, SOIL_FRICTION, COHESION, TAN_PHI, K_C, K_PHI, EXPONENT, SHEAR_MODULUS = range(
    SOIL_NUMBERS
)
"""Columns of the table of `pack_soils`."""
COULOMB, BEKKER_WONG = 0.0, 1.0
"""Values of the column SOIL_MODEL."""
MIN_PULL = 1e-3
"""Least effective friction, for wheels without drawbar pull; above 0 because it is a divisor."""
MAX_NEWTON_STEPS = 50
"""Largest number of Newton steps of `find_mobilisation`."""


def pack_soils(names: Sequence[str] = (), default: str | None = None) -> NDArray[np.float64]:
    """Return a table of preset soils for the kernels.

    Args:
        names: Soils of a terrain's soil layer, ``terrain.soil_names``.
        default: Soil where the layer is -1, or everywhere without a layer (default: Coulomb
            friction with the coefficient of the terrain or the rover).

    Returns:
        Table (1 + number of names, SOIL_NUMBERS): row 0 is the default, row 1 + k is
        ``names[k]``.

    Raises:
        SoilError: A name that is not among the soils.
    """
    table = np.zeros((1 + len(names), SOIL_NUMBERS))
    table[:, SOIL_FRICTION] = np.nan
    for row, name in enumerate((default, *names)):
        if name is not None:
            _write_soil(soil_named(name), table[row])
    return table


def _write_soil(soil: Soil, row: NDArray[np.float64]) -> None:
    if soil.model == COULOMB_MODEL:
        row[SOIL_MODEL], row[SOIL_FRICTION] = COULOMB, soil.friction
        return
    row[SOIL_MODEL] = BEKKER_WONG
    row[COHESION], row[TAN_PHI] = soil.cohesion, np.tan(soil.friction_angle)
    row[K_C], row[K_PHI], row[EXPONENT] = soil.k_c, soil.k_phi, soil.n
    row[SHEAR_MODULUS] = soil.shear_modulus


class SoilWheel(NamedTuple):
    """Parameters of a wheel for the soil models."""

    radius: float
    """Radius r [m]."""
    width: float
    """Width b [m]."""
    friction: float
    """Coulomb coefficient for a Coulomb soil without its own."""


class WheelOnSoil(NamedTuple):
    """State of a wheel that exerts given forces."""

    slip_ratio: float
    """i = 1 - v / (r omega), from -1 (braking) to 1 (spinning on the spot). It is -1 or 1 if the
    forces exceed the soil's strength."""
    sinkage: float
    """Sinkage [m]."""
    resistance: float
    """Motion resistance [N]."""
    torque: float
    """Wheel torque [N m] that the forces need."""
    utilisation: float
    """(T, S) relative to the largest forces in its direction: above 1 if it exceeds the soil's
    strength, infinite if no forces in that direction are within it."""


@kernel
def coulomb_slip(utilisation):
    """Return the slip ratio i = 1 - v / (r omega) on Coulomb ground.

    It is 0 up to the friction limit, where the wheel sticks, and 1 above, where it spins.
    """
    return 0.0 if utilisation <= 1.0 else 1.0


@kernel
def solve_wheel(soil, wheel, N, T, S):
    """Find slip, sinkage, resistance and torque of a wheel for the forces of the equilibrium.

    Args:
        soil: (8,) a row of `pack_soils`.
        wheel: SoilWheel.
        N: Load along the contact normal [N].
        T: Net traction forward along the ground (drawbar pull) [N]; negative if braking.
        S: Lateral force [N].

    Returns:
        WheelOnSoil. A wheel without load has slip 1, infinite utilisation, torque r T, and zeros
        otherwise.
    """
    mu, radius, width = wheel.friction, wheel.radius, wheel.width
    if not N > 0.0:
        return WheelOnSoil(1.0, 0.0, 0.0, radius * T, np.inf)
    if soil[SOIL_MODEL] == COULOMB:
        largest = _own_friction(soil, mu) * N
        utilisation = np.sqrt(T * T + S * S) / largest
        slip = coulomb_slip(utilisation)
        return WheelOnSoil(slip, 0.0, 0.0, radius * T, utilisation)
    sinkage = find_sinkage(soil, radius, width, N)
    resistance = motion_resistance(soil, width, sinkage)
    length = contact_length(radius, sinkage)
    strength = shear_strength(soil, width * length, N)
    largest = _largest_thrust(soil, radius, sinkage, length, strength)
    thrust = T + resistance
    utilisation = use_of_shear(T, S, resistance, largest)
    slip = 1.0 if thrust >= 0.0 else -1.0
    if utilisation <= 1.0:
        slip = _slip_of_thrust(thrust, S, strength, soil[SHEAR_MODULUS] / length)
    return WheelOnSoil(slip, sinkage, resistance, radius * thrust, utilisation)


@kernel
def effective_friction(soil, wheel, N):
    """Return the largest drawbar pull over the load N [N], at least MIN_PULL.

    All forces with sqrt(T^2 + S^2) up to this coefficient times N are within the soil's strength,
    unless MIN_PULL applies. For Bekker-Wong it depends on the load. `soil` is a row of
    `pack_soils`, `wheel` a SoilWheel.
    """
    if soil[SOIL_MODEL] == COULOMB:
        return _own_friction(soil, wheel.friction)
    if not N > 0.0:
        return MIN_PULL
    strength, resistance = grip_on(soil, wheel, N)
    return max(strength - resistance, MIN_PULL)


@kernel
def grip_on(soil, wheel, N):
    """Return the thrust at slip 1, at least MIN_PULL, and the resistance, over the load N [N].

    `soil` is a row of `pack_soils`, `wheel` a SoilWheel.
    """
    if soil[SOIL_MODEL] == COULOMB:
        return _own_friction(soil, wheel.friction), 0.0
    sinkage = find_sinkage(soil, wheel.radius, wheel.width, N)
    length = contact_length(wheel.radius, sinkage)
    strength = shear_strength(soil, wheel.width * length, N)
    thrust = _largest_thrust(soil, wheel.radius, sinkage, length, strength)
    return max(thrust / N, MIN_PULL), motion_resistance(soil, wheel.width, sinkage) / N


@kernel
def _own_friction(soil, mu):
    """Return the Coulomb coefficient of a soil, or `mu` if it has none."""
    own = soil[SOIL_FRICTION]
    return own if own > 0.0 else mu


@kernel
def find_sinkage(soil, radius, width, N):
    """Return the sinkage z0 [m] of a rigid wheel under load N [N] (Bekker; Wong, section 2.4).

    z0 = (3 N / ((3 - n) (k_c + b k_phi) sqrt(D)))^(2 / (2 n + 1))
    """
    n = soil[EXPONENT]
    stiffness = (3.0 - n) * (soil[K_C] + width * soil[K_PHI]) * np.sqrt(2.0 * radius)
    return (3.0 * N / stiffness) ** (2.0 / (2.0 * n + 1.0))


@kernel
def motion_resistance(soil, width, sinkage):
    """Return the resistance [N] of compacting a rut, R = (k_c + b k_phi) z0^(n + 1) / (n + 1)."""
    rise = soil[EXPONENT] + 1.0
    return (soil[K_C] + width * soil[K_PHI]) * sinkage**rise / rise


@kernel
def contact_length(radius, sinkage):
    """Return the arc [m] of rim in the soil, l = r arccos(1 - z0 / r), at most a quarter."""
    # This form is accurate for a sinkage much smaller than the radius.
    return 2.0 * radius * np.arcsin(np.sqrt(0.5 * min(sinkage / radius, 1.0)))


@kernel
def shear_strength(soil, area, N):
    """Return the shear force [N] of a fully mobilised contact (Mohr-Coulomb), A c + N tan(phi)."""
    return area * soil[COHESION] + N * soil[TAN_PHI]


@kernel
def mobilised_share(x):
    """Return 1 - (1 - exp(-x)) / x, the share of the strength mobilised at x = i l / K >= 0."""
    if x < 1e-3:
        return x * (1.0 / 2.0 - x * (1.0 / 6.0 - x * (1.0 / 24.0 - x / 120.0)))
    return 1.0 + np.expm1(-x) / x


@kernel
def find_mobilisation(share):
    """Return the x >= 0 at which `mobilised_share` is `share`, 0 <= share < 1.

    It is the root of x (1 - share) = 1 - exp(-x). The difference of both sides is convex, so
    Newton's method converges from any start above the root.
    """
    if share < 1e-5:
        return share * (2.0 + share * 4.0 / 3.0)
    rest = 1.0 - share
    x = min(1.0, 2.0 * share) / rest
    for _ in range(MAX_NEWTON_STEPS):
        change = (x * rest + np.expm1(-x)) / (rest - np.exp(-x))
        x -= change
        if not change > 1e-14 * x:
            break
    return x


@kernel
def _largest_thrust(soil, radius, sinkage, length, strength):
    """Return the thrust [N] at slip 1; 0 for a wheel sunk to its axle."""
    if sinkage >= radius:
        return 0.0
    return strength * mobilised_share(length / soil[SHEAR_MODULUS])


@kernel
def use_of_shear(T, S, resistance, largest):
    """Return (T, S) relative to the largest forces in its direction.

    The soil's strength is the circle sqrt((T + R)^2 + S^2) <= F(1).

    Args:
        T: Net traction [N].
        S: Lateral force [N].
        resistance: Motion resistance R [N].
        largest: Largest thrust F(1) [N].
    """
    room = (largest - resistance) * (largest + resistance)
    if room > 0.0:
        along = T * resistance
        return (along + np.sqrt(along * along + (T * T + S * S) * room)) / room
    # T = S = 0 is outside the circle: the other wheels have to drag this wheel.
    thrust = T + resistance
    needed = np.sqrt(thrust * thrust + S * S)
    return needed / largest if needed < largest else np.inf


@kernel
def _slip_of_thrust(thrust, S, strength, shear_ratio):
    """Return the slip ratio of a thrust [N] within the strength [N]; `shear_ratio` is K / l.

    Shear stress is opposite to shear displacement. The longitudinal slip is therefore the total
    slip times the thrust's share of the total shear force.
    """
    needed = np.sqrt(thrust * thrust + S * S)
    if needed == 0.0:
        return 0.0
    whole = min(find_mobilisation(needed / strength) * shear_ratio, 1.0)
    return whole * thrust / needed
