"""Surveys of whole maps: where a rover can stand and drive, and what it can reach."""
