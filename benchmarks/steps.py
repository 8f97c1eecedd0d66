"""Finds the steps that a rover climbs in MuJoCo for several heights of its bogie pivot.

Run from the repository: python -m benchmarks.steps [Z ...], with heights of the pivot in m,
default PIVOTS. The results are in docs/studies.md.
"""

import sys

from rover_physics.rover.model import Rover
from rover_physics.rover.rover_file import load_rover
from rover_planner.simulator.mujoco_plant import MujocoPlant
from rover_planner.studies.objectives import step_ground, tallest_step
from rover_planner.studies.rover_keys import vary

PIVOTS = (-0.14, -0.08, -0.03, 0.05)
HEIGHTS = (0.07, 0.075, 0.08, 0.085, 0.09, 0.10)
"""Heights of the steps [m]."""
FRICTION = 0.5
SPEED, LONGEST = 0.05, 100.0
"""Speed of the drive [m/s], and the longest time of a drive [s]."""
START, END = -0.75, 0.65
"""x of the body at the start, and beyond the step where the drive has succeeded [m]."""


def climb(rover: Rover, height: float) -> float:
    """Return x of the body [m] when the rover has passed END or its time is up."""
    plant = MujocoPlant(rover, step_ground(rover, height), (START, 0.0, 0.0), FRICTION)
    for _ in range(round(LONGEST / 0.1)):
        plant.drive(SPEED, 0.0, 0.1)
        if plant.pose()[0] > END:
            break
    return float(plant.pose()[0])


def main() -> None:
    """Print a line for each pivot."""
    preset = load_rover("lsr1")
    for z in [float(word) for word in sys.argv[1:]] or PIVOTS:
        rover = vary(preset, {("suspension", "bogie_pivot", 2): z})
        study = tallest_step(rover, "optimal", FRICTION)
        ends = {height: climb(rover, height) for height in HEIGHTS}
        words = [f"{h:g}: {'up' if x > END else f'stopped at {x:.2f}'}" for h, x in ends.items()]
        print(f"pivot {z:g} m, study {study:.4f} m; steps [m] {', '.join(words)}", flush=True)


if __name__ == "__main__":
    main()
