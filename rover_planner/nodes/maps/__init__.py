"""The maps of a traverse server as topics and services."""
