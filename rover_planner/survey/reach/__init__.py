"""What can be reached on a surveyed map and returned from."""
