"""A live rover: its topics, kept for the page."""
