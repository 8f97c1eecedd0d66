"""Writes results as messages: predictions, verdicts, markers and diagnostics."""
