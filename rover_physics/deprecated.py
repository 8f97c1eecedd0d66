# SPDX-License-Identifier: Apache-2.0
"""Names of version 0.1 that work for one more version, with a warning.

Each takes the arguments of the function that replaces it, and returns its prediction on an exact
map, without the verdict.
"""

import warnings
from collections.abc import Callable
from functools import wraps
from typing import Any

from rover_physics.traversability.judge import judge_path, judge_paths, judge_poses


def _old_name(name: str, judge: Callable[..., Any], pick: Callable[[Any], Any]) -> Any:
    """Return the function of an old name; `pick` takes predictions from what `judge` returns."""

    @wraps(judge)
    def sweep(*arguments: Any, **named: Any) -> Any:
        now = f"{judge.__name__} returns the prediction and the verdict"
        text = f"{name} goes with the next version; {now}"
        warnings.warn(text, DeprecationWarning, stacklevel=2)
        return pick(judge(*arguments, sigmas=0, **named))

    return sweep


sweep_path = _old_name("sweep_path", judge_path, lambda judged: judged[0])
sweep_paths = _old_name("sweep_paths", judge_paths, lambda judged: [one[0] for one in judged])
sweep_poses = _old_name("sweep_poses", judge_poses, lambda judged: judged[0])
