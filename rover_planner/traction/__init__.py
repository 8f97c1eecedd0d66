"""The traction controller without ROS: measurements in, torques out."""
