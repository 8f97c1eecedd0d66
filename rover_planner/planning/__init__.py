"""Path planning without ROS: candidate paths, their verdicts, and the answers to queries."""
