"""Where the wheels touch the ground, and the pose in which all six do."""
