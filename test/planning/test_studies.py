# SPDX-License-Identifier: Apache-2.0
"""Studies find what is best, say what cannot be, and read their files as strictly as others."""

import csv

import numpy as np
import pytest

from rover_physics import load_rover
from rover_physics.errors import RoverFileError
from rover_physics.rover.rover_file import preset_names, rover_to_dict
from rover_planner.cli import main
from rover_planner.errors import PlanningError
from rover_planner.studies import rover_values
from rover_planner.studies.objectives import tallest_step, why_not_climbed
from rover_planner.studies.runner import describe_ties, run_study
from rover_planner.studies.study_file import study_from_dict
from support.rovers import LSR1

PIVOT_X = {"name": "suspension.bogie_pivot.x", "from": 0.10, "to": 0.30, "count": 9}


def study(**changes):
    data = {"rover": "lsr1", "objective": "load_imbalance", "parameters": [dict(PIVOT_X)]}
    return study_from_dict(data | changes, "study")


def test_an_optimisation_finds_the_bogie_midway_between_its_wheels_where_loads_are_even():
    found = run_study(study(method="optimise", evaluations=40))
    assert len(found.trials) <= 40
    assert found.best.values[0] == pytest.approx(0.2, abs=0.02)
    assert found.best.objective == pytest.approx(1.0, abs=0.02)
    assert found.ties == () and describe_ties(found) == ""


def test_the_tallest_step_is_climbed_and_a_little_more_is_not():
    height = tallest_step(LSR1, "equal", 0.6)
    assert tallest_step(LSR1, "optimal", 0.6) >= height
    assert 0.02 < height < 0.3
    assert not why_not_climbed(LSR1, height, "equal", 0.6)
    assert why_not_climbed(LSR1, height + 0.004, "equal", 0.6)


def test_a_rover_that_cannot_be_is_a_trial_with_a_note_and_no_value():
    parameters = [{"name": "suspension.wheels.rear.x", "from": -0.4, "to": 0.4, "count": 3}]
    result = run_study(study(parameters=parameters))
    assert [bool(trial.note) for trial in result.trials] == [False, True, True]
    assert np.isnan(result.trials[-1].load_shares).all()
    assert np.isnan(result.trials[-1].objective)
    assert "wheels" in result.trials[-1].note


def test_a_drive_that_breaks_another_limit_gives_no_value_but_the_reason_and_a_long_one_does():
    mass = {"name": "masses.body.mass", "from": 4.0, "to": 6.0, "count": 2}
    parameters = [{"name": "belly.z", "from": -0.285, "to": -0.1, "count": 2}, mass]
    long_drive = {"step": 0.05, "start": [-1.0, 1.0, -0.3], "length": 6.0}
    drives = [{"slope": 0.1, "length": 0.1}, long_drive]
    trials = run_study(
        study(objective="worst_utilisation", drives=drives, parameters=parameters)
    ).trials
    assert len({trial.values for trial in trials}) == 4  # all combinations
    for trial in trials:
        is_low = trial.values[0] < -0.2
        assert np.isnan(trial.objective) == is_low == ("drive 1: belly clearance" in trial.note)


def test_the_tip_over_margin_is_an_angle_that_tells_wide_rovers_from_narrow_ones():
    parameters = [
        {
            "name": "suspension.wheels.rear.y", "from": 0.25, "to": 0.4, "count": 2,
            "also": ["suspension.wheels.middle.y", "suspension.wheels.front.y"],
        }
    ]  # fmt: skip
    drives = [{"slope": 0.2, "length": 0.1, "start": [0.0, 0.0, 1.5708]}]
    task = study(objective="tip_over_margin", drives=drives, parameters=parameters)
    narrow, wide = run_study(task).trials
    height = LSR1.masses.body.com[2] - LSR1.suspension.wheels["rear"][2] + LSR1.wheel.radius
    assert narrow.objective < wide.objective < np.arctan(0.4 / height) + 0.5
    assert run_study(task).baseline.values == (0.31,)


WHEEL = {"name": "wheel.radius", "from": 1e8, "to": 1e9, "count": 2}
MANY = [
    {"name": name, "from": 0.5, "to": 0.9, "count": 1000}
    for name in ("wheel.radius", "wheel.width", "wheel.mass", "masses.body.mass")
]
WORST = {"objective": "worst_utilisation"}


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        (WORST, "drives is missing"),
        ({"parameters": [PIVOT_X | {"name": "wheel.radios"}]}, "wheel.radius"),
        ({"parameters": [PIVOT_X | {"to": 0.0}]}, "above from"),
        ({"parameters": [PIVOT_X, PIVOT_X]}, "no other parameter varies"),
        ({"parameters": [PIVOT_X | {"also": ["wheel.mass"]}]}, "names of numbers in m"),
        ({"soil": "dry_sand"}, "left out"),
        ({"objective": "tip_over_margin", "drives": [{"length": 1.0}]}, "one of slope"),
        ({"objective": "tip_over_margin", "drives": [{"slope": 3}]}, "slope is 3 at most 1.5"),
        (WORST | {"drives": [{"slope": 0.1, "length": 1e300}]}, r"a drive is 1e\+300 m long"),
        (WORST | {"drives": [{"slope": 0.1, "length": 1e3}]}, r"a ground of 2e\+03 m in cells"),
        ({"parameters": MANY}, r"parameters have 1e\+12 combinations"),
        ({"parameters": [WHEEL], "objective": "tallest_step"}, "no rover of could be judged"),
    ],
)
def test_an_impossible_study_is_refused_by_name(changes, text):
    with pytest.raises((PlanningError, RoverFileError), match=r".*".join(text.split())):
        _ = run_study(study(**changes)).best


@pytest.mark.parametrize("name", preset_names())
def test_every_value_is_within_its_range_and_can_be_set(name):
    rover = load_rover(name)
    data = rover_to_dict(rover)
    for values in rover_values.list_values(rover).values():
        for value in values:
            now = rover_values.get_value(data, value.keys[0])
            assert value.low <= now <= value.high and value.low < value.high, value.label
            assert value.label.endswith("]"), value.label
            assert rover_values.vary(rover, dict.fromkeys(value.keys, now)) == rover


def test_the_command_writes_a_table_and_a_picture(tmp_path, capsys):
    file = tmp_path / "loads.yaml"
    file.write_text(
        "rover: lsr1\nobjective: load_imbalance\nparameters:\n"
        "  - {name: suspension.bogie_pivot.x, from: 0.1, to: 0.3, count: 5}\n"
    )
    assert main(["study", str(file), "--output", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    assert "suspension.bogie_pivot.x = 0.2 m" in said
    assert "suspension.bogie_pivot.x: 0.1 to 0.3 m, now 0.2" in said
    with (tmp_path / "out" / "loads.csv").open() as table:
        rows = list(csv.reader(table))
    assert rows[0][0] == "suspension.bogie_pivot.x [m]" and len(rows) == 6
    assert (tmp_path / "out" / "loads.png").read_bytes()[:4] == b"\x89PNG"
    best = load_rover(tmp_path / "out" / "loads_best.yaml")
    assert best.suspension.bogie_pivot[0] == pytest.approx(0.2)
    assert main(["study", str(tmp_path / "none.yaml")]) == 2


def test_rovers_as_good_within_the_resolution_are_named():
    parameters = [{"name": "suspension.bogie_pivot.z", "from": -0.08, "to": -0.06, "count": 3}]
    result = run_study(study(objective="tallest_step", friction=0.5, parameters=parameters))
    values = [trial.objective for trial in result.trials]
    assert max(values) - min(values) < 0.002  # the heights are found to 2 mm
    assert len(result.ties) == 2 and result.best not in result.ties
    assert describe_ties(result).startswith("as good within 0.002 m: bogie pivot z ")
