"""The web page that shows the rover on the terrain: what it will do, and why it can or cannot."""
