"""Parts of the node /mission_planner."""
