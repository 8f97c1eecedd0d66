# SPDX-License-Identifier: Apache-2.0
"""Measures in MuJoCo how a rover on a slope rests when it is no longer driven, by rest policy.

Run from the repository: python -m benchmarks.hold [--slope DEG] [--seconds S]
It needs the extra `bench`. Its results are in docs/validation.md. The rover rests, is enabled and
climbs or descends at its nominal speed, steered along the fall line by a path follower; then an
input is lost or the command becomes zero, and the steering stays as it is. Torques reach the
wheels two periods (40 ms) after the measurement.
"""

from collections import deque
from dataclasses import dataclass
from typing import Annotated

import numpy as np
import typer

from benchmarks.drives import LOOK_AHEAD, PERIOD
from benchmarks.measure import print_table
from rover_physics import load_rover
from rover_physics.rover.steered_drive import SteeredDrive
from rover_planner.parameters.traction_controller import (
    BRAKE,
    REST_POLICIES,
    TractionControllerParameters,
)
from rover_planner.simulator.mujoco_rover import MujocoRover
from rover_planner.simulator.path_follower import PathFollower
from rover_planner.traction.settings import load_traction_settings
from rover_planner.traction.supervisor import TractionSupervisor
from support.rough_grounds import plane

DELAY = 2
"""Periods from a measurement to its torques at the wheels."""
FRICTION = 0.8
SETTLING_TIME = 1.0
"""Time at rest before the rover is enabled [s]."""
EVENT_TIME = SETTLING_TIME + 3.0
"""Time of the event [s]."""
EVENTS = ("cmd_vel lost", "imu lost", "wheel rates lost", "commanded to stop", "emergency stop")
ROVERS = {"lsr1": 6.0, "m2020": 12.0}
"""Rovers, and half the length of their slope [m]."""


@dataclass(frozen=True)
class Rest:
    """State and motion of a rover after an event."""

    state: str
    """State of the controller at the end."""
    brake: bool
    """True if the controller commanded the brake at the end."""
    peak: float
    """Largest distance from the place of the event [m]."""
    end: float
    """Distance along the slope since the event, positive uphill [m]."""
    speed: float
    """Speed at the end [m/s]."""


def rest_on_slope(rover_name: str, policy: str, event: str, slope: float, seconds: float) -> Rest:
    """Drive along a slope [rad] (negative: downhill) and rest for a time [s] after an event.

    A brake that is commanded locks the wheels: with the policy brake only, as other rovers may
    have none.
    """
    rover = load_rover(rover_name)
    ground = plane(np.tan(abs(slope)), 0.0, half=ROVERS[rover_name])
    heading = 0.0 if slope > 0.0 else np.pi
    plant = MujocoRover(rover, ground, (0.0, 0.0, heading), FRICTION)
    parameters = TractionControllerParameters(
        rover=rover_name, rest_policy=policy, friction=FRICTION
    )
    supervisor = TractionSupervisor(load_traction_settings(parameters), False)
    path = np.array([[0.0, 0.0, heading], [np.sign(slope) * ROVERS[rover_name], 0.0, heading]])
    follower, steered = PathFollower(path, LOOK_AHEAD), SteeredDrive(rover)
    delayed = deque([supervisor.update(plant.time)] * DELAY)
    places = []
    while plant.time < EVENT_TIME + seconds:
        over = plant.time > EVENT_TIME
        if plant.time > SETTLING_TIME and not over:
            supervisor.permission.set_enabled(True)
        if not over:
            asked = follower.steer(plant.pose[[0, 1, 3]], rover.nominal_speed)
            plant.steer(steered.aim(*asked).angles)
        _measure(supervisor, plant, event if over else "", asked)
        delayed.append(supervisor.update(plant.time))
        command = delayed.popleft()
        if policy == BRAKE and command.brake:
            plant.servo(np.zeros(6), PERIOD)
        else:
            plant.step(command.torques, PERIOD)
        if over:
            places.append(float(plant.pose[0]))
    along = (np.array(places) - places[0]) / np.cos(slope)
    return Rest(
        state=command.state,
        brake=command.brake,
        peak=float(np.abs(along).max()),
        end=float(along[-1]),
        speed=float((along[-1] - along[-2]) / PERIOD),
    )


def _measure(
    supervisor: TractionSupervisor, plant: MujocoRover, event: str, asked: tuple[float, float]
) -> None:
    """Give a supervisor what it measures after an event (empty: none), and what is asked of it."""
    service, now = supervisor.service, plant.time
    if event != "wheel rates lost":
        service.take_joints(plant.joint_positions, plant.joint_velocities, now)
    if event != "imu lost":
        service.take_attitude(*plant.attitude, plant.body_rates, now)
    if event != "cmd_vel lost":
        service.take_command(*((0.0, 0.0) if event == "commanded to stop" else asked), now)
    if event == "emergency stop":
        supervisor.permission.take_emergency_stop(True)


def main(
    slope: Annotated[float, typer.Option(help="Slope in degrees.")] = 20.0,
    seconds: Annotated[float, typer.Option(help="Time of rest in s.")] = 5.0,
) -> None:
    """Run all cases and print a table."""
    rows = []
    for rover in ROVERS:
        for policy in REST_POLICIES:
            for event in EVENTS:
                for direction, sign in (("up", 1.0), ("down", -1.0)):
                    rest = rest_on_slope(rover, policy, event, sign * np.radians(slope), seconds)
                    cells = f"{rest.peak:.3f}", f"{rest.end:+.3f}", f"{rest.speed:+.3f}"
                    rows.append((rover, direction, policy, event, rest.state, rest.brake, *cells))
    headings = ("rover", "drives", "policy", "event", "state", "~/brake", "farthest [m]",
                "end, uphill [m]", "speed [m/s]")  # fmt: skip
    title = f"Slope of {slope:g} deg, friction {FRICTION:g}, {seconds:g} s after the event"
    print_table(title, headings, rows)


if __name__ == "__main__":
    typer.run(main)
