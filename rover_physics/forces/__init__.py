"""What the ground's forces are: balance, torques, soil, tip-over measures."""
