# SPDX-License-Identifier: Apache-2.0
"""The commands `urdf` and `rover`: files there and back, and one line for bad input."""

from rover_physics.rover.rover_file import load_rover
from rover_planner.cli import main


def test_a_preset_goes_to_urdf_and_back(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["urdf", "lsr1", "lsr1.urdf", "--map", "joints.yaml"]) == 0
    words = ["rover", "--from-urdf", "lsr1.urdf", "--map", "joints.yaml", "again.yaml"]
    assert main(words) == 0
    assert (
        "wrote again.yaml: lsr1, 8.3 kg, left and right differ by 0 mm" in capsys.readouterr().out
    )
    assert load_rover("again.yaml") == load_rover("lsr1")
