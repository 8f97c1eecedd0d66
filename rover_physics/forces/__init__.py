"""Forces between wheels and ground: equilibrium, torques, soil, tip-over measures."""
