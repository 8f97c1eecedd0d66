"""Configuration files: location, reading and checks."""
