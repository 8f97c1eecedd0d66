# SPDX-License-Identifier: Apache-2.0
"""The error that invalid messages raise."""

from rover_physics.errors import RoverError

MAX_TEXT = 500
"""Largest number of characters of an error; a message may contain names of any length."""


class MessageError(RoverError):
    """A message with a missing or invalid field or a wrong frame; the text names it."""

    def __init__(self, text: str):
        super().__init__(text if len(text) <= MAX_TEXT else f"{text[: MAX_TEXT - 3]}...")
