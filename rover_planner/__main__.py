"""Runs the command `rover_planner` as `python -m rover_planner`."""

import sys

from rover_planner.cli import main

if __name__ == "__main__":
    sys.exit(main())
