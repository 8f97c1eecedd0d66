# SPDX-License-Identifier: Apache-2.0
"""Calls of kernels run in threads; kernels are made at the top of their modules."""

import ast
import functools
import threading
import time

import pytest

from rover_physics.numerics.kernel_cache import _only_load, loading_only
from rover_physics.numerics.threads import CALLS_IN_WORK, run_in_turn
from support.project.checkout import TOP


@pytest.mark.parametrize("threads", [1, 3])
def test_a_call_begins_when_the_one_whose_work_space_it_takes_has_ended(threads):
    spaces = CALLS_IN_WORK * threads
    ended = [threading.Event() for _ in range(50)]
    early = []

    def call(k):
        if k >= spaces and not ended[k - spaces].is_set():
            early.append(k)
        time.sleep(0.002 * (k % 3))
        ended[k].set()

    run_in_turn((functools.partial(call, k) for k in range(50)), threads)
    assert not early and all(one.is_set() for one in ended)


def test_calls_are_drawn_while_others_run_and_an_error_among_them_ends_the_work():
    ran = []

    def calls():
        for k in range(50):
            if k == 20:
                raise InterruptedError
            yield functools.partial(ran.append, k)

    with pytest.raises(InterruptedError):
        run_in_turn(calls(), 3)
    assert len(ran) >= 20 - CALLS_IN_WORK * 3 and set(ran) <= set(range(20))

    def fail():
        raise ValueError("call")

    with pytest.raises(ValueError, match="call"):
        run_in_turn(iter([fail] * 50), 3)


@pytest.mark.parametrize("threads", [1, 3])
def test_calls_know_the_block_that_only_loads_kernels(threads):
    known = []
    with loading_only():
        run_in_turn((lambda: known.append(_only_load.get()) for _ in range(9)), threads)
    assert known == [True] * 9


def test_kernels_are_not_made_by_functions():
    """Kernels of one name from one line differ for Python only: on disk they may be mixed up."""
    found = []
    for package in ("rover_physics", "rover_planner"):
        for path in (TOP / package).rglob("*.py"):
            text = path.read_text(encoding="utf-8")
            tree = ast.parse(text if "kernels" in text else "")
            for node in set(ast.walk(tree)) - set(tree.body):
                marks = {ast.unparse(mark) for mark in getattr(node, "decorator_list", ())}
                called = getattr(node, "func", None)
                name = getattr(called, "id", getattr(called, "attr", ""))
                is_made = isinstance(node, ast.Call) and name.endswith("kernel")
                if is_made or marks & {"kernel", "exact_kernel", "allocating_kernel"}:
                    found.append(f"{path.name}:{node.lineno}")
    assert not found
