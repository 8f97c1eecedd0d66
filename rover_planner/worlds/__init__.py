"""Generated terrains: fractal relief, craters and rocks from a seed."""
