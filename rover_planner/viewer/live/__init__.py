"""A live rover: the data of its topics, kept for the page."""
