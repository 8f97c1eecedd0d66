"""Which steps a rover climbs in MuJoCo, by the height of its bogie pivot. See docs/studies.md.

Run from the repository, with pivots in m if not all: python -m benchmarks.steps [Z ...]
"""

import sys

from rover_physics.rover.model import Rover
from rover_physics.rover.rover_file import load_rover
from rover_planner.simulator.mujoco_plant import MujocoPlant
from rover_planner.studies.objectives import step_ground, tallest_step
from rover_planner.studies.rover_keys import vary

PIVOTS = (-0.14, -0.08, -0.03, 0.05)
HEIGHTS = (0.07, 0.075, 0.08, 0.085, 0.09, 0.10)
"""Steps that are tried [m]."""
FRICTION = 0.5
SPEED, LONGEST = 0.05, 100.0
"""Of the drive [m/s], and the time after which a rover counts as stopped [s]."""
START, END = -0.75, 0.65
"""Places of the body before and behind the step [m]."""


def climb(rover: Rover, height: float) -> float:
    """Return where the body of a rover is when it is up, or its time is [m]."""
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
