# SPDX-License-Identifier: Apache-2.0
"""Why a mission planner gives up."""


class NoAnswerError(Exception):
    """What a node waits for did not come in time; the text names it."""


class DriveFailedError(Exception):
    """The rover did not reach the end of its path; the text names the reason."""
