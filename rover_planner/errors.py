"""The root of the errors that planning raises."""


class PlanningError(Exception):
    """A request that has no meaning; the text names the argument and what would be right."""


class DemoError(Exception):
    """The demo could not be carried out; the text says which part failed and how."""
