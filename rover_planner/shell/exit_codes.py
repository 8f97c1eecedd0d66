# SPDX-License-Identifier: Apache-2.0
"""Exit codes of the command line and of the node programs."""

EXIT_OK = 0
"""The program ran, with any verdict of the model."""
EXIT_FAILED = 1
"""The input was good, but a part of the system failed, or the program has a defect."""
EXIT_BAD_INPUT = 2
"""The input is invalid or a library is missing; one line on stderr names it."""
EXIT_NOT_TRAVERSABLE = 3
"""mission_planner only: all queries were answered, and at least one goal is not traversable."""
EXIT_NO_ANSWER = 4
"""mission_planner only: no server, or no answer in time."""
EXIT_PIPE_CLOSED = 141
"""Nobody reads the output any more, as in `rover_planner ... | head`: 128 + SIGPIPE."""
EXIT_INTERRUPTED = 130
"""Interrupted by Ctrl-C: 128 + SIGINT, as in shells."""
