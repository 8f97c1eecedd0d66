"""Trials of a traverse server in a process of its own, over DDS."""
