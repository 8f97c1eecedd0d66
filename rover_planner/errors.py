# SPDX-License-Identifier: Apache-2.0
"""The errors that this package raises."""

from rover_physics.errors import RoverError


class PlanningError(RoverError):
    """An invalid request; the text names the argument and the allowed values."""


class FailedError(Exception):
    """A part of the system failed; the text names it and the reason."""

    exit_code = 1
    """That of the program."""


class DemoError(FailedError):
    """A failure of the demo."""


class DriveFailedError(FailedError):
    """The rover did not reach the end of its path."""


class NoAnswerError(FailedError):
    """What a node waits for did not come in time."""

    exit_code = 4
