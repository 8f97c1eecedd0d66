# SPDX-License-Identifier: Apache-2.0
"""Starts the command line of `rover_planner`, also as `python -m rover_planner`."""

import sys

from rover_planner.shell.run_program import EXIT_INTERRUPTED


def main() -> int:
    """Run the command and return its exit code, also if Ctrl-C comes before it is imported."""
    try:
        from rover_planner.cli import main as run
    except KeyboardInterrupt:
        return EXIT_INTERRUPTED
    return run()


if __name__ == "__main__":
    sys.exit(main())
