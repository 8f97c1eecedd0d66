"""Node parameters: one dataclass per node, used for declaration, checks and documentation."""
