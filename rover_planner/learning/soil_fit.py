# SPDX-License-Identifier: Apache-2.0
"""An estimate of the parameters of soft ground, from thrust, slip and resistance of the wheels.

Pieces of path of a wheel radius measure how much all wheels pull beyond what moves the rover,
which is their resistance, and the thrust of each wheel at its slip. Four parameters of the soil
model (docs/soil.md) are fitted to the last pieces, with what is told as the prior.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from rover_physics.errors import SoilError
from rover_physics.forces.soil import (
    BEKKER_WONG,
    COHESION,
    EXPONENT,
    K_C,
    K_PHI,
    SHEAR_MODULUS,
    SOIL_MODEL,
    TAN_PHI,
    contact_length,
    find_sinkage,
    mobilised_share,
    motion_resistance,
    pack_soils,
    shear_strength,
)
from rover_physics.names import WHEEL_COUNT
from rover_physics.numerics.arrays import Floats
from rover_physics.numerics.kernels import kernel
from rover_physics.rover.model import Rover
from rover_planner.learning.wheel_slip import SlipWindow

PARAMETERS = ("modulus", "cohesion", "friction_angle", "shear_modulus")
"""The parameters: k_c / b + k_phi [N/m^(n+2)] at the told exponent n, c [Pa], phi [rad], K [m]."""
PRIOR_SPREAD = np.array([2.0, 1.0, 0.4, 0.7])
"""Standard deviations of their logarithms about what is told (of tan phi for phi)."""
PIECES = 100
"""Number of pieces that are kept."""
RESISTANCE_NOISE = 0.01
"""Standard deviation of the resistance of a piece over the load."""
THRUST_NOISE, LEAST_NOISE = 0.06, 0.01
"""Relative and least standard deviation of a wheel's thrust over its load."""
COMMON = 0.03
"""Relative standard deviation of what all pieces have in common: masses, radius."""
ROUNDS, MOST_CHANGE = 30, 0.5
"""Most rounds of a fit, and the largest change of a logarithm in one."""
ENOUGH = 1e-3
"""Change of the logarithms at which a fit ends."""
STEP = 1e-4
"""Step of a logarithm or slip for its derivative."""
TOLD_APART = 0.5
"""Spread over the prior's below which the drive has told a parameter."""


@dataclass(frozen=True)
class SoilEstimate:
    """What is known of a soil, as pairs of mean and standard deviation."""

    parameters: dict[str, tuple[float, float]]
    """The PARAMETERS."""
    told_apart: tuple[str, ...]
    """Those that the drive tells; the others are mostly what was told."""
    trade: float
    """Correlation of cohesion and friction angle; near -1 they trade off."""
    sinkage: tuple[float, float]
    """Sinkage of a wheel under a sixth of the weight [m]."""
    resistance: tuple[float, float]
    """Its motion resistance over its load."""
    strength: tuple[float, float]
    """Its thrust at slip 1 over its load."""


@dataclass(frozen=True, eq=False)
class _Piece:
    """Means over a piece of the path."""

    loads: Floats
    slips: Floats
    slip_noise: float
    measured: Floats
    """(7,) thrusts over loads; the resistance of all wheels over their load."""
    noise: Floats


class SoilFit:
    """The estimate of one soil under one rover."""

    def __init__(self, rover: Rover, weight: float, told: str):
        """Start with what is told.

        Args:
            rover: The rover.
            weight: Its weight [N].
            told: Name of a soil of config/soils.yaml that yields.

        Raises:
            SoilError: No soil of that name, or one that does not yield.
        """
        soil = pack_soils(default=told)[0]
        if soil[SOIL_MODEL] != BEKKER_WONG:
            raise SoilError(f"soil {told} does not yield: it has a friction, which is learned")
        wheel = rover.wheel
        self._load, self._gravity = weight / WHEEL_COUNT, rover.gravity
        self._radius, self._width, self._n = wheel.radius, wheel.width, soil[EXPONENT]
        modulus = soil[K_C] / wheel.width + soil[K_PHI]
        told_values = [modulus, max(soil[COHESION], 1.0), soil[TAN_PHI], soil[SHEAR_MODULUS]]
        self._told = self._logs = np.log(told_values)
        self._pieces: deque[_Piece] = deque(maxlen=PIECES)
        self._estimate: SoilEstimate | None = None
        self._begin()

    def _begin(self) -> None:
        self._distance = self._time = 0.0
        self._sums = np.zeros((7, WHEEL_COUNT))

    def take(self, window: SlipWindow, good: NDArray[np.bool_], elapsed: float) -> None:
        """Take a window of a steady drive, in which wheels (6,) can be believed or not."""
        rolling, forward = window.rolling, float(np.sign(np.median(window.rolling)))
        usable = good & (window.clear > 0.0) & (window.loads > 0.1 * self._load)
        if not usable.all() or (forward * rolling < 5.0 * (window.deviation + window.scrub)).any():
            self._begin()
            return
        unsteady = window.unsteadiness / window.duration / self._gravity
        values = [
            forward * rolling, forward * window.slip, window.aside,
            window.loads, forward * window.tractions,
            np.full(WHEEL_COUNT, window.deviation * window.duration),
            np.full(WHEEL_COUNT, forward * window.excess / (WHEEL_COUNT * self._load) - unsteady),
        ]  # fmt: skip
        self._sums += elapsed * np.array(values)
        self._time += elapsed
        self._distance += elapsed * float(np.abs(rolling).mean())
        if self._distance >= self._radius:
            self._pieces.append(self._end_piece())
            self._estimate = None
            self._begin()

    def _end_piece(self) -> _Piece:
        rolling, slip, aside, loads, thrusts, jitter, share = self._sums / self._time
        noise = float(jitter[0]) / self._time  # of the distance between two ends, over the time
        aside = np.sqrt(np.maximum(aside**2 - noise**2, 0.0))
        whole = np.maximum(np.hypot(slip, aside), 1e-9)
        ahead = np.where(slip > 0.5 * whole, slip / whole, np.nan)
        measured = np.append(thrusts / loads / ahead, share[0])
        spread = np.append(np.hypot(THRUST_NOISE * measured[:-1], LEAST_NOISE), RESISTANCE_NOISE)
        speed = float(rolling.mean())
        return _Piece(loads, np.minimum(whole / rolling, 1.0), noise / speed, measured, spread)

    def _fit(self) -> Floats:
        """Fit the parameters to the pieces; return their covariance (4, 4)."""
        for _ in range(ROUNDS):
            gain = np.diag(PRIOR_SPREAD**-2.0)
            force = gain @ (self._told - self._logs)
            for piece in self._pieces:
                push = partial(self._push, loads=piece.loads)
                here = push(self._logs, slips=piece.slips)
                J = _differentiate(partial(push, slips=piece.slips), self._logs, here)
                steep = (push(self._logs, slips=piece.slips + STEP) - here) / STEP
                steep[-1] = 0.0
                known = np.isfinite(piece.measured)
                # The noise of the motion is the same in the slips of all wheels.
                covariance = np.diag(piece.noise**2)
                covariance += piece.slip_noise**2 * np.outer(steep, steep)
                weights = np.linalg.inv(covariance[np.ix_(known, known)])
                gain = gain + J[known].T @ weights @ J[known]
                force = force + J[known].T @ weights @ (piece.measured - here)[known]
            change = np.clip(np.linalg.solve(gain, force), -MOST_CHANGE, MOST_CHANGE)
            self._logs = self._logs + change
            if np.abs(change).max() < ENOUGH:
                break
        return np.asarray(np.linalg.inv(gain))

    def _push(self, logs: Floats, loads: Floats, slips: Floats) -> Floats:
        """Return (7,) thrusts over loads, and the resistance of all wheels over their load."""
        thrusts, resistances, _ = self._model(logs, loads, slips)
        return np.append(thrusts / loads, resistances.sum() / loads.sum())

    def _model(self, logs: Floats, loads: Floats, slips: Floats) -> Floats:
        """Return (3, 6) thrusts and resistances [N] and sinkages [m] of wheels."""
        soil, found = pack_soils()[0], np.empty((3, WHEEL_COUNT))
        soil[K_C], soil[EXPONENT] = 0.0, self._n
        soil[K_PHI], soil[COHESION], soil[TAN_PHI], soil[SHEAR_MODULUS] = np.exp(logs)
        _push_wheels(soil, self._radius, self._width, loads, slips, found)
        return found

    def _describe(self, logs: Floats) -> Floats:
        """Return (3,) strength, resistance and sinkage of a wheel under a sixth of the weight."""
        even = np.full(WHEEL_COUNT, self._load)
        return self._model(logs, even, np.ones(WHEEL_COUNT))[:, 0] / [self._load, self._load, 1.0]

    def find_estimate(self) -> SoilEstimate:
        """Return what is known now; it costs time after each new piece only."""
        if self._estimate is None:
            self._estimate = self._find_estimate()
        return self._estimate

    def _find_estimate(self) -> SoilEstimate:
        covariance = self._fit()
        spread = np.sqrt(np.diag(covariance))
        is_told = spread < TOLD_APART * PRIOR_SPREAD
        values = np.exp(self._logs)
        deviations = values * np.hypot(spread, COMMON)
        deviations[2] /= 1.0 + values[2] ** 2  # d phi = d tan(phi) / (1 + tan(phi)^2)
        values[2] = np.arctan(values[2])
        pairs = zip(values.tolist(), deviations.tolist(), strict=True)
        here = self._describe(self._logs)
        slopes = _differentiate(self._describe, self._logs, here)
        spreads = np.hypot(np.sqrt(np.diag(slopes @ covariance @ slopes.T)), COMMON * here)
        strength, resistance, sinkage = zip(here.tolist(), spreads.tolist(), strict=True)
        return SoilEstimate(
            parameters=dict(zip(PARAMETERS, pairs, strict=True)),
            told_apart=tuple(n for n, told in zip(PARAMETERS, is_told, strict=True) if told),
            trade=float(covariance[1, 2] / (spread[1] * spread[2])),
            sinkage=sinkage,
            resistance=resistance,
            strength=strength,
        )


def _differentiate(function: Callable[[Floats], Floats], logs: Floats, here: Floats) -> Floats:
    """Return the derivatives (n, 4) of a function of logarithms, whose value is `here` (n,)."""
    steps = STEP * np.eye(len(logs))
    return np.stack([function(logs + step) - here for step in steps], axis=1) / STEP


@kernel
def _push_wheels(soil, radius, width, loads, slips, found):
    """Write thrusts and resistances [N] and sinkages [m] (3, 6) of wheels at loads and slips."""
    for wheel in range(WHEEL_COUNT):
        load = loads[wheel]
        sinkage = min(find_sinkage(soil, radius, width, load), radius)
        length = contact_length(radius, sinkage)
        share = mobilised_share(slips[wheel] * length / soil[SHEAR_MODULUS])
        found[0, wheel] = share * shear_strength(soil, width * length, load)
        found[1, wheel] = motion_resistance(soil, width, sinkage)
        found[2, wheel] = sinkage
