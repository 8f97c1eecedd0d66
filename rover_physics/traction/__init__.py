"""Traction control: the quadratic program that shares the torques, and contact angles for it."""
