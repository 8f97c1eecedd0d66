# SPDX-License-Identifier: Apache-2.0
"""The API of rover_physics: its names work from the package, and cost nothing before their use."""

import subprocess
import sys

import pytest

import rover_physics


def test_every_name_of_the_api_is_there():
    for name in rover_physics.__all__:
        assert getattr(rover_physics, name) is not None, name
    assert set(rover_physics.__all__) <= set(dir(rover_physics))


def test_a_name_that_is_not_there_is_refused_by_name():
    with pytest.raises(AttributeError, match="jugde_path"):
        _ = rover_physics.jugde_path


def test_nothing_is_imported_before_its_use():
    code = (
        "import sys, rover_physics; print('numba' in sys.modules); "
        "from rover_physics import load_rover; load_rover('lsr1'); print('numba' in sys.modules)"
    )
    ran = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=300, check=True
    )
    assert ran.stdout.split() == ["False", "False"]
