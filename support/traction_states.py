# SPDX-License-Identifier: Apache-2.0
"""Measured states of settled rovers and motions between them, computed from predictions."""

import numpy as np

from rover_physics import PathPrediction, Rover, Terrain, judge_path
from rover_physics.traction.balance import MeasuredState
from rover_physics.traction.contact_ekf import Motion
from support.rover_geometry import wheel_axes


def state_of(rover: Rover, prediction: PathPrediction, i: int) -> MeasuredState:
    """Return the measured state at waypoint i."""
    arms = prediction.contact_points[i] - prediction.wheel_centres[i]
    return MeasuredState(
        prediction.roll[i],
        prediction.pitch[i],
        prediction.rocker_angle[i, 0],
        prediction.bogie_angle[i],
        prediction.contact_angle[i],
        np.sum(arms * wheel_axes(rover, prediction, i), axis=1),
        prediction.steering_angle[i],
    )


def drive_states(rover: Rover, ground: Terrain):
    """Return prediction, motions and time step [s] of a drive along +x at 3 cm/s."""
    x = np.linspace(-1.2, 1.2, 1201)
    prediction = judge_path(rover, ground, np.column_stack([x, 0.0 * x, 0.0 * x]))[0]
    duration = (x[1] - x[0]) / 0.03

    def rate(values):
        return np.gradient(values, duration, axis=0)

    roll, pitch = prediction.roll, prediction.pitch
    turning = np.column_stack(
        [rate(roll), rate(pitch) * np.cos(roll), -rate(pitch) * np.sin(roll)]
    )
    rocker, bogie = rate(prediction.rocker_angle), rate(prediction.bogie_angle)
    speeds = np.linalg.norm(rate(prediction.wheel_centres), axis=2)
    names = ("rear", "middle", "front")
    hung = np.array([name != rover.suspension.rocker_wheel for name in names] * 2)
    sides = np.repeat([0, 1], 3)
    links = turning[:, [1]] + rocker[:, sides] + bogie[:, sides] * hung
    motions = [
        Motion(
            np.array([roll[i], pitch[i]]),
            np.array([prediction.rocker_angle[i, 0], *prediction.bogie_angle[i]]),
            np.array([rocker[i, 0], *bogie[i]]),
            speeds[i] / rover.wheel.radius - links[i], turning[i], np.zeros(6),
        )
        for i in range(len(x))
    ]  # fmt: skip
    return prediction, motions, duration
