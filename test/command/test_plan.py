# SPDX-License-Identifier: Apache-2.0
"""Tests of the commands plan and replay-plan."""

import json

import numpy as np
import pytest

from rover_physics.terrain.grid import save_terrain
from rover_planner.cli import main
from support.grounds import long_wall, make_terrain

ENDS = ("--start=-2.5,0,0", "--goal=2.5,0,0")


@pytest.fixture(scope="module")
def ground(tmp_path_factory):
    """Return a terrain file with a wall that is open at one end."""
    path = tmp_path_factory.mktemp("plan") / "ground.npz"
    save_terrain(path, make_terrain(long_wall))
    return path


def test_a_way_is_written_with_its_predictions_and_predict_passes_it(ground, tmp_path, capfd):
    out, picture, dump = (tmp_path / name for name in ("way.npz", "way.png", "asked.npz"))
    words = ["plan", "lsr1", str(ground), str(out), *ENDS, "--budget", "60"]
    assert main([*words, "--picture", str(picture), "--dump", str(dump)]) == 0
    report = json.loads(capfd.readouterr().out)
    assert report["found"] is True and report["reason"] == ""
    for name in ("length", "energy", "time", "risk", "seconds_first", "seconds", "bound"):
        assert report[name] > 0.0
    assert 0 < report["edges_judged"] < report["edges"] and report["expanded"] > 0
    with np.load(out) as way:
        assert bool(way["traversable"]) and way["wheel_loads"].shape == (len(way["poses"]), 6)
        steps = np.hypot(*np.diff(way["poses"][:, :2], axis=0).T)
        assert steps.max() <= 0.02 + 1e-9
        assert steps.sum() == pytest.approx(report["length"], rel=1e-3)
        poses = way["poses"]
    assert picture.stat().st_size > 10_000
    assert main(["predict", "lsr1", str(ground), str(out), str(tmp_path / "p.npz")]) == 0
    assert "traversable" in capfd.readouterr().out
    assert main(["replay-plan", str(dump), str(tmp_path / "again.npz")]) == 0
    again = json.loads(capfd.readouterr().out)
    assert again["cost"] == report["cost"] and again["repeatable"] is True
    with np.load(tmp_path / "again.npz") as way:
        np.testing.assert_array_equal(way["poses"], poses)


def test_without_a_way_no_file_is_written_and_the_reason_is_told(ground, tmp_path, capfd):
    out = tmp_path / "way.npz"
    words = ["plan", "lsr1", str(ground), str(out), "--start=-2.5,0,0", "--goal=0,0,0"]
    assert main(words) == 0
    report = json.loads(capfd.readouterr().out)
    assert report["found"] is False and report["outcome"] == "goal_refused"
    assert "cannot stand at the goal" in report["reason"] and report["length"] is None
    assert not out.exists()
