"""Messages for tests, and message packages that PyPI lacks."""
