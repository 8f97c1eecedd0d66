"""Exit codes of the command line and of the node programs."""

EXIT_OK = 0
"""It ran, whatever the verdict of the model."""
EXIT_FAILED = 1
"""The input was good, but a part of the system failed."""
EXIT_BAD_INPUT = 2
"""The input makes no sense, or a library is missing; one line on stderr says which."""
EXIT_NOT_TRAVERSABLE = 3
"""mission_planner only: every question was answered, and at least one goal is not traversable."""
EXIT_NO_ANSWER = 4
"""mission_planner only: no server, or no answer in time."""
EXIT_INTERRUPTED = 130
"""Ctrl-C, as shells have it."""
