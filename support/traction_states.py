# SPDX-License-Identifier: Apache-2.0
"""Measured states of settled rovers and motions between them, computed from predictions."""

import numpy as np

from rover_physics import PathPrediction, Rover, Terrain, judge_path
from rover_physics.traction.balance import MeasuredState
from rover_physics.traction.contact_ekf import Motion
from support.reference_drives import drive_path
from support.rover_geometry import place_rover


def state_of(rover: Rover, prediction: PathPrediction, i: int) -> MeasuredState:
    """Return the measured state at waypoint i."""
    arms = prediction.contact_points[i] - prediction.wheel_centres[i]
    return MeasuredState(
        prediction.roll[i],
        prediction.pitch[i],
        prediction.rocker_angle[i, 0],
        prediction.bogie_angle[i],
        prediction.contact_angle[i],
        np.sum(arms * place_rover(rover, prediction, i).axles, axis=1),
        prediction.steering_angle[i],
    )


STRAIGHT = drive_path(0.002)
SPEED = 0.03
"""Speed of a drive [m/s]."""


def drive_states(rover: Rover, ground: Terrain, path: np.ndarray = STRAIGHT):
    """Return prediction, motions and time step [s] of a drive along poses of equal distances."""
    prediction = judge_path(rover, ground, path)[0]
    duration = np.hypot(*(path[1] - path[0])[:2]) / SPEED

    def rate(values):
        return np.gradient(values, duration, axis=0)

    roll, pitch, steering = prediction.roll, prediction.pitch, prediction.steering_angle
    roll_rate, pitch_rate, yaw_rate = rate(roll), rate(pitch), rate(path[:, 2])
    turning = np.column_stack([
        roll_rate - np.sin(pitch) * yaw_rate,
        np.cos(roll) * pitch_rate + np.sin(roll) * np.cos(pitch) * yaw_rate,
        -np.sin(roll) * pitch_rate + np.cos(roll) * np.cos(pitch) * yaw_rate,
    ])  # fmt: skip
    rocker, bogie = rate(prediction.rocker_angle), rate(prediction.bogie_angle)
    speeds = np.linalg.norm(rate(prediction.wheel_centres), axis=2)
    hung = place_rover(rover, prediction, 0).on_bogie
    sides = np.repeat([0, 1], 3)
    links = turning[:, [1]] + rocker[:, sides] + bogie[:, sides] * hung
    about_axles = links * np.cos(steering) - turning[:, [0]] * np.sin(steering)
    motions = [
        Motion(
            np.array([roll[i], pitch[i]]),
            np.array([prediction.rocker_angle[i, 0], *prediction.bogie_angle[i]]),
            np.array([rocker[i, 0], *bogie[i]]),
            speeds[i] / rover.wheel.radius - about_axles[i], turning[i], steering[i],
        )
        for i in range(len(path))
    ]  # fmt: skip
    return prediction, motions, duration
