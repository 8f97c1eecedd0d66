# SPDX-License-Identifier: Apache-2.0
"""Drawings that follow the verdict: one at a time, between the requests of visitors."""

from collections.abc import Callable
from contextlib import AbstractContextManager

from rover_planner.viewer.panel.error_notice import ErrorNotice
from rover_planner.viewer.state.visitor_requests import Action


class Drawings:
    """What is still to be drawn, in the order in which it was asked for.

    A drawing shows what there is when it is done. One that is asked for again while it waits is
    done once, at its old place in the order: it is never put off by newer changes. All methods
    belong to the page's own thread, except for `waiting`.
    """

    def __init__(self, errors: ErrorNotice, together: Callable[[], AbstractContextManager[None]]):
        """Begin with nothing to draw.

        Args:
            errors: Shows what could not be drawn.
            together: Returns a context whose messages reach the visitors together.
        """
        self._errors, self._together = errors, together
        self._asked: dict[str, Action] = {}

    @property
    def waiting(self) -> bool:
        """Whether something is still to be drawn, or is being drawn."""
        return bool(self._asked)

    def ask(self, failure: str, draw: Action) -> None:
        """Draw something soon.

        Args:
            failure: What the page says if it fails, such as "the paths are not drawn"; it also
                tells drawings apart.
            draw: Draws it.
        """
        self._asked[failure] = draw

    def draw_next(self) -> None:
        """Draw what has waited longest, if there is anything."""
        if not self._asked:
            return
        failure, draw = next(iter(self._asked.items()))
        self._errors.run(failure, lambda: self._draw(draw))
        if self._asked[failure] is draw:
            del self._asked[failure]

    def draw_all(self) -> None:
        """Draw all that waits."""
        while self._asked:
            self.draw_next()

    def _draw(self, draw: Action) -> None:
        with self._together():
            draw()
