"""Conversions between ROS messages and numpy: pure functions, one file per kind of message."""
