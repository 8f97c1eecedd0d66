"""Log lines about what lasts or repeats."""
