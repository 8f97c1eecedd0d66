"""Studies: which numbers of a rover are best for what it is to drive over."""
