"""The rover: its numbers, its file, its linkage and its manipulator."""
