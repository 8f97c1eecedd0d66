# SPDX-License-Identifier: Apache-2.0
"""Benchmarks still run against the product as it is; what they find is not looked at here."""

import importlib

import pytest

pytest.importorskip("rclpy", reason="benchmarks start nodes")
from support.project.checkout import TOP


@pytest.mark.parametrize("name", sorted(file.stem for file in (TOP / "benchmarks").glob("*.py")))
def test_every_benchmark_can_be_imported(name):
    pytest.importorskip("mujoco", reason="install the extra bench")
    importlib.import_module(f"benchmarks.{name}")
