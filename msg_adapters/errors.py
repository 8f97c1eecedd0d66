"""The error that invalid messages raise."""


class MessageError(Exception):
    """A message with a missing or invalid field or a wrong frame; the text names it."""
