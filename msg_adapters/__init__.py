"""ROS messages to numpy and back: pure functions, one file per kind of message."""
