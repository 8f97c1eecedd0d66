# SPDX-License-Identifier: Apache-2.0
"""The buttons of the camera, above the tabs: views to choose, and going along with the rover."""

from collections.abc import Callable, Sequence
from typing import Any

FOLLOW, STAY = "Follow", "Stay"
"""The last button: go along with the rover, or stop that."""


class CameraButtons:
    """One row of buttons; the last one changes its name."""

    def __init__(
        self,
        gui: Any,
        views: Sequence[str],
        look: Callable[[Any, str], None],
        follow: Callable[[bool], None],
    ):
        """Add the row to the container that is open.

        Args:
            gui: The GUI of viser.
            views: Names of the views.
            look: Lets a visitor's camera, by its client of viser, take a view.
            follow: Lets the cameras go along with the rover or not.
        """
        self._views, self._look, self._follow = tuple(views), look, follow
        self._follows = False
        self._group = gui.add_button_group("Camera", (*self._views, FOLLOW))
        self._group.on_click(self._press)

    def show(self, follows: bool) -> None:
        """Name the last button by what it does next."""
        if follows != self._follows:
            self._follows = follows
            self._group.options = (*self._views, STAY if follows else FOLLOW)

    def _press(self, event: Any) -> None:
        name = event.target.value
        if name in self._views:
            self._look(event.client, name)
        else:
            self._follow(name == FOLLOW)
