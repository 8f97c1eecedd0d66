"""A simulated rover on a terrain with the interfaces of a real rover."""
