"""Inputs and outputs of the traction controller."""
