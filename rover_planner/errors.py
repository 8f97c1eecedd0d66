# SPDX-License-Identifier: Apache-2.0
"""The errors that this package raises."""

from rover_physics.errors import RoverError


class PlanningError(RoverError):
    """An invalid request; the text names the argument and the allowed values."""


class DemoError(Exception):
    """A failure of the demo; the text names the part that failed and the reason."""


class DriveFailedError(Exception):
    """The rover did not reach the end of its path; the text names the reason."""
