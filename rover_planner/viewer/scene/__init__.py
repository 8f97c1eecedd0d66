"""The 3-D scene: ground, rover, forces, and what is drawn over the ground."""
