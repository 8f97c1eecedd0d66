"""The error of every message that cannot be understood."""


class MessageError(Exception):
    """A message with something missing, impossible or in another frame; the text names it."""
