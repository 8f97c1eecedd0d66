# SPDX-License-Identifier: Apache-2.0
"""Runs the command line of `rover_planner` by `python -m rover_planner`."""

import sys

from rover_planner.cli import main

if __name__ == "__main__":
    sys.exit(main())
