"""Parameters of the nodes: a dataclass each, which declaration, checks and docs are made from."""
