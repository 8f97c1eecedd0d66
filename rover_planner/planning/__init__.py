"""What a mission planner asks, without ROS: candidate paths, their verdicts, the answer."""
