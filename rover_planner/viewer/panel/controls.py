# SPDX-License-Identifier: Apache-2.0
"""Reads the values that visitors give the page's controls."""

from collections.abc import Callable
from typing import Any


def on_visitor_input(control: Any, action: Callable[[Any], None]) -> None:
    """Call a quick action with each value that a visitor gives a control.

    The value is read at once, on the loop that received it. Callbacks are otherwise called in a
    thread of their own, before which the page may have set another value.
    """

    async def read(event: Any) -> None:
        if event.client is not None:
            action(event.target.value)

    control.on_update(read)


def on_slider_input(slider: Any, action: Callable[[float], None]) -> None:
    """Call a quick action with each number that a visitor gives a slider.

    A number that is typed may be beyond the slider's ends; it is limited to them.
    """
    on_visitor_input(slider, lambda value: action(min(max(float(value), slider.min), slider.max)))
