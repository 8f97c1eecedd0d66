"""The one frame of a map: what arrives in another is refused, since nothing is transformed."""

from msg_adapters.errors import MessageError


def check_frame(frame_id: str, map_frame: str, what: str) -> None:
    """Refuse a message in any other frame than the map's.

    Raises:
        MessageError: the frame is empty or another one; the text says which is right.
    """
    if frame_id != map_frame:
        given = f"in frame {frame_id!r}" if frame_id else "without a frame_id"
        raise MessageError(f"{what} is {given}; it must be in {map_frame!r}")
