"""Traction control: the quadratic program for the torques, and contact angles for it."""
