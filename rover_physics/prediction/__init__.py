"""The model along a path: poses in, predictions out."""
