"""The four nodes and their topics."""
