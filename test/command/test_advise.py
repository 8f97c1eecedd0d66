# SPDX-License-Identifier: Apache-2.0
"""`advise` keeps its contract: remedies in a file that `predict` passes with."""

import json

import numpy as np
import pytest

from rover_physics import save_terrain
from rover_planner.advice import seek
from rover_planner.advice.advise import STOPPED
from rover_planner.advice.levers import LEVERS
from rover_planner.cli import main
from rover_planner.planning.answering.budget import Budget
from rover_planner.shell.run_program import EXIT_INTERRUPTED
from support.command_line import assert_refused, predict_arguments
from support.grounds import make_terrain
from support.paths import poses_at

KEYS = {
    "levers", "words", "options", "largest_use", "use_before", "chance", "extra_time",
    "extra_energy", "extra_distance", "needs_others",
}  # fmt: skip
PATH = poses_at(np.arange(-1.0, 1.0, 0.05))


@pytest.fixture
def files(tmp_path):
    save_terrain(tmp_path / "terrain.npz", make_terrain(lambda x, y: 0.3 * x))
    np.savez(tmp_path / "poses.npz", poses=PATH)
    return tmp_path


def arguments(files, *words):
    """Return the words of the command, with time enough for a busy machine."""
    names = "terrain.npz", "poses.npz", "out.json"
    return ["advise", "lsr1", *(str(files / name) for name in names), "--budget", "300", *words]


def options_of(remedy):
    """Return the options of `predict` that a remedy names."""
    told, words = dict(remedy["options"]), []
    if told.pop("backward", False):
        words.append("--backward")
    for joint, angle in told.pop("joint_angles", {}).items():
        words += ["--arm", f"{joint}={angle}"]
    for name, value in told.items():
        words += [f"--{name.replace('_', '-')}", str(value)]
    return words


def test_each_remedy_is_what_predict_passes_with(files, capsys, monkeypatch):
    few = [one for one in LEVERS if one.name in ("payload", "policy", "arm_shoulder", "shift")]
    monkeypatch.setattr(seek, "LEVERS", few)
    assert main(arguments(files, "--payload", "4")) == 0
    printed = capsys.readouterr().out
    advice = json.loads((files / "out.json").read_text())
    assert advice["complete"] is True and advice["remedies"]
    assert printed.startswith("refused: ") and "\n1. " in printed
    for remedy in advice["remedies"]:
        assert remedy.keys() >= KEYS and remedy["words"] in printed
        assert {*remedy["levers"][0]} == {"name", "value", "unit", "from"}
        np.savez(files / "poses.npz", poses=remedy.get("poses", PATH))
        words = options_of(remedy)
        payload = [] if "--payload" in words else ["--payload", "4"]
        assert main([*predict_arguments(files), *words, *payload]) == 0
        assert "waypoints, traversable" in capsys.readouterr().out, remedy["words"]


def test_a_path_that_passes_and_one_without_time_are_answered(files, capsys, monkeypatch):
    assert main(arguments(files, "--friction", "1.0")) == 0
    advice = json.loads((files / "out.json").read_text())
    assert advice["traversable"] and advice["complete"]
    assert not advice["remedies"] and not advice["others"]
    assert capsys.readouterr().out == "the path is traversable as it is\n"
    monkeypatch.setattr(Budget, "remaining", 0.0)
    assert main(arguments(files)) == 0
    answer = json.loads((files / "out.json").read_text())
    assert (answer["code"], answer["reason"]) == ("too_long", STOPPED)
    assert not answer["complete"] and not answer["remedies"]
    assert capsys.readouterr().out == f"{STOPPED}; a larger --budget tries more\n"


def test_an_interruption_before_the_first_result_is_told(files, capsys, monkeypatch):
    def interrupt(_budget: Budget) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Budget, "check", interrupt)
    assert main(arguments(files)) == EXIT_INTERRUPTED
    assert capsys.readouterr().err == f"{STOPPED}\n"
    assert not (files / "out.json").exists()


def test_files_that_cannot_be_written_are_refused_as_bad_input(files, capfd):
    words = arguments(files)
    words[4] = str(files / "none" / "out.json")
    assert_refused(capfd, main(words), "out.json: cannot be written")
    picture = str(files / "none" / "out.png")
    assert_refused(capfd, main(arguments(files, "--picture", picture)), "cannot be written")
    assert not (files / "out.json").exists()
