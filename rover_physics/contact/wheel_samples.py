# SPDX-License-Identifier: Apache-2.0
"""Sample points of a wheel's cylinder: angles along circles across its width."""

from typing import Any

import numpy as np

from rover_physics.numerics.records import new_record, record_type
from rover_physics.rover.model import Rover

MAX_ANGLES, MAX_CIRCLES = 49, 9
"""Largest numbers of angles and circles, which fix the sizes of the records."""
RIMS = 3
"""Scanned circles: both rims and the middle one."""
WHEEL_SAMPLES = record_type(
    ("radius", float),  # wheel radius [m]
    ("extent", float),  # largest horizontal distance of a sample from the wheel's centre [m]
    ("rows", np.int64),  # number k of contact angles
    ("circles", np.int64),  # number m of circles
    ("sines", float, (MAX_ANGLES,)),  # (k,) sines of the contact angles, ascending
    ("cosines", float, (MAX_ANGLES,)),  # (k,) their cosines
    ("spacing_sine", float),  # sine of the angle between neighbouring samples
    ("spacing_cosine", float),  # cosine of the angle between neighbouring samples
    ("half_width", float),  # distance of the outer circles from the middle plane [m]
    ("laterals", float, (MAX_CIRCLES,)),  # (m,) distances from the middle plane [m], ascending
)
"""Samples of a wheel's cylinder: k angles on each of m circles."""


def sample_wheel(rover: Rover, resolution: float) -> Any:
    """Return WHEEL_SAMPLES about as dense as the cells of a terrain of `resolution` [m].

    There are 21 to 49 angles and 5 to 9 circles.
    """
    wheel = rover.wheel
    half_angles = int(np.clip(np.ceil(0.5 * np.pi * wheel.radius / resolution), 10, 24))
    half_laterals = int(np.clip(np.ceil(0.5 * wheel.width / resolution), 2, 4))
    angles = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 2 * half_angles + 1)
    samples = new_record(
        WHEEL_SAMPLES,
        radius=wheel.radius,
        extent=np.hypot(wheel.radius, 0.5 * wheel.width),
        rows=angles.size,
        circles=2 * half_laterals + 1,
        half_width=0.5 * wheel.width,
        spacing_sine=np.sin(angles[1] - angles[0]),
        spacing_cosine=np.cos(angles[1] - angles[0]),
    )
    samples.sines[: angles.size], samples.cosines[: angles.size] = np.sin(angles), np.cos(angles)
    half = samples.half_width
    samples.laterals[: samples.circles] = np.linspace(-half, half, samples.circles)
    return samples
