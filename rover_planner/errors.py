"""The root of the errors that planning raises."""


class PlanningError(Exception):
    """A request to the planner that has no meaning: the text names the argument and what would be right."""
