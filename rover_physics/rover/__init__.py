"""Rover: parameters, rover file, linkage and manipulator."""
