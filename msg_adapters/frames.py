"""Checks the frame of messages: only the map frame is accepted, nothing is transformed."""

from msg_adapters.errors import MessageError


def check_frame(frame_id: str, map_frame: str, what: str) -> None:
    """Check that a message is in the map frame.

    Raises:
        MessageError: The frame is empty or differs; the text names the right one.
    """
    if frame_id != map_frame:
        given = f"in frame {frame_id!r}" if frame_id else "without a frame_id"
        raise MessageError(f"{what} is {given}; it must be in {map_frame!r}")
