"""Studies find what is best, say what cannot be, and read their files as strictly as others."""

import csv

import numpy as np
import pytest

from rover_physics.errors import RoverFileError
from rover_physics.rover import load_rover
from rover_planner.cli import main
from rover_planner.studies.objectives import climbs, tallest_step
from rover_planner.studies.rover_keys import find_key, vary
from rover_planner.studies.runner import run_study
from rover_planner.studies.study_file import study_from_dict
from rover_planner.viewer.rover_values import rover_to_dict

LSR1 = load_rover("lsr1")
PIVOT_X = {"name": "suspension.bogie_pivot.x", "from": 0.10, "to": 0.30, "count": 9}


def study(**changes):
    data = {"rover": "lsr1", "objective": "load_imbalance", "parameters": [dict(PIVOT_X)]}
    return study_from_dict(data | changes, "study")


def test_loads_are_even_where_the_bogie_hangs_midway_between_its_wheels():
    best = run_study(study()).best
    assert best.values[0] == pytest.approx(0.2)
    assert best.objective == pytest.approx(1.0, abs=0.02)


def test_equal_load_shares_need_the_least_friction_on_nearly_level_ground():
    drives = [{"slope": 0.05, "length": 0.1}, {"slope": -0.05, "length": 0.1}]
    best = run_study(study(objective="worst_utilisation", drives=drives)).best
    assert best.values[0] == pytest.approx(0.2, abs=0.026)


def test_an_optimisation_finds_what_a_sweep_finds():
    found = run_study(study(method="optimise", evaluations=40))
    assert len(found.trials) <= 40
    assert found.best.values[0] == pytest.approx(0.2, abs=0.02)


def test_the_tallest_step_is_climbed_and_a_little_more_is_not():
    height = tallest_step(LSR1, "equal", 0.6)
    assert 0.02 < height < 0.3
    assert climbs(LSR1, height, "equal", 0.6)
    assert not climbs(LSR1, height + 0.004, "equal", 0.6)


def test_best_torques_climb_at_least_as_high_as_equal_ones():
    assert tallest_step(LSR1, "optimal", 0.6) >= tallest_step(LSR1, "equal", 0.6)


def test_a_rover_that_cannot_be_is_a_trial_with_a_note_and_no_value():
    parameters = [{"name": "suspension.wheels.rear.x", "from": -0.4, "to": 0.4, "count": 3}]
    result = run_study(study(parameters=parameters))
    assert [bool(trial.note) for trial in result.trials] == [False, True, True]
    assert np.isnan(result.trials[-1].objective)
    assert "wheels" in result.trials[-1].note


def test_two_parameters_are_tried_in_all_combinations():
    parameters = [
        PIVOT_X | {"count": 2},
        {"name": "masses.body.mass", "from": 4.0, "to": 6.0, "count": 3},
    ]
    result = run_study(study(parameters=parameters))
    assert len({trial.values for trial in result.trials}) == 6


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"objective": "fastest"}, "objective is 'fastest'"),
        ({"objective": "worst_utilisation"}, "drives is missing"),
        ({"parameters": []}, "a list of one mapping or more"),
        ({"parameters": [PIVOT_X | {"name": "wheel.radios"}]}, "wheel.radius"),
        ({"parameters": [PIVOT_X | {"to": 0.0}]}, "above from"),
        ({"parameters": [PIVOT_X | {"steps": 3}]}, "steps"),
        ({"method": "guess"}, "method is 'guess'"),
        ({"objective": "tip_over_margin", "drives": [{"length": 1.0}]}, "one of slope"),
    ],
)
def test_what_a_study_file_must_not_say_is_refused_by_name(changes, text):
    with pytest.raises(RoverFileError, match=r".*".join(text.split())):
        study(**changes)


def test_every_number_of_a_rover_has_a_name_and_a_unit():
    contents = rover_to_dict(LSR1)
    for name, unit, value in (
        ("wheel.radius", "m", 0.1),
        ("suspension.wheels.front.x", "m", 0.4),
        ("masses.body.mass", "kg", 5.0),
        ("manipulator.stowed.1", "rad", -0.2),
        ("friction", "", 0.8),
    ):
        key, found = find_key(contents, name, "study")
        assert found == unit
        inner = contents
        for part in key:
            inner = inner[part]
        assert inner == value
        assert vary(LSR1, (key,), (value,)) == LSR1


def test_the_command_writes_a_table_and_a_picture(tmp_path, capsys):
    file = tmp_path / "loads.yaml"
    file.write_text(
        "rover: lsr1\nobjective: load_imbalance\nparameters:\n"
        "  - {name: suspension.bogie_pivot.x, from: 0.1, to: 0.3, count: 5}\n"
    )
    assert main(["study", str(file), "--output", str(tmp_path / "out")]) == 0
    assert "suspension.bogie_pivot.x = 0.2 m" in capsys.readouterr().out
    with (tmp_path / "out" / "loads.csv").open() as table:
        rows = list(csv.reader(table))
    assert rows[0][0] == "suspension.bogie_pivot.x [m]" and len(rows) == 6
    assert (tmp_path / "out" / "loads.png").read_bytes()[:4] == b"\x89PNG"
    assert main(["study", str(tmp_path / "none.yaml")]) == 2
