"""A mark for tests that take minutes and show little that a shorter one does not show too."""

import os

import pytest

on_demand = pytest.mark.skipif(
    "ROVER_LONG_TESTS" not in os.environ, reason="takes minutes: set ROVER_LONG_TESTS=1"
)
