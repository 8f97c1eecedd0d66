"""What a drive needs without ROS: watch of the path, hazard map, frames."""
