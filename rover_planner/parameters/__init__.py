"""Parameters of the nodes: one table each, from which declaration, checks and docs are made."""
