"""The traction controller without ROS: computes torques from measurements."""
