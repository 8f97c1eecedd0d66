"""A rover on a terrain that behaves towards its nodes as a real one does."""
