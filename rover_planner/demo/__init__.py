"""The demo: a server, a planner that asks it, a table and a picture."""
