"""Recorded messages: bags are read, their questions answered again, and answers recorded."""
