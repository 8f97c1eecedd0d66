"""Design studies: sweeps and optimisations of a rover's numbers."""
