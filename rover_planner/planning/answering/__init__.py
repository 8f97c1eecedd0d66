"""What a traverse server knows, and its answers to questions; without ROS."""
