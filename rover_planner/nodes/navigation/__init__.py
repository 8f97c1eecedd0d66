"""Topics and services for drives: watch of the path, hazard map, frames."""
