"""Throws malformed and hostile inputs at adapters, services and running nodes: `make fuzz`."""
