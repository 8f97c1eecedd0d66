"""The pages: one that plans, one that follows a live rover."""
