# SPDX-License-Identifier: Apache-2.0
"""Tests of the files that hold a question for a path."""

import numpy as np
import pytest

from rover_physics import load_rover, save_terrain
from rover_planner.errors import PlanningError
from rover_planner.planning.path_query import PathQueryOptions
from rover_planner.planning.search.query import LatticeSettings, SearchQuery
from rover_planner.planning.search.query_file import read_query, write_query
from support.grounds import make_terrain, waves

SETTINGS = LatticeSettings(budget=3.5, cell=0.25)


@pytest.fixture
def written(tmp_path):
    options = PathQueryOptions().change(policy="servo", friction=0.6, payload=0.5)
    question = SearchQuery(
        load_rover("lsr1"), make_terrain(waves), (-1.0, 0.5, 0.2), (1.0, 0.0, 3.0), options
    )
    write_query(tmp_path / "question.npz", question, SETTINGS)
    return tmp_path / "question.npz", question


def test_a_question_is_read_as_it_was_written(written):
    path, question = written
    read, settings = read_query(path)
    assert settings == SETTINGS
    assert (read.rover, read.options) == (question.rover, question.options)
    assert read.options.model.joint_angles is None
    np.testing.assert_array_equal(read.start, question.start)
    np.testing.assert_array_equal(read.goal, question.goal)
    np.testing.assert_array_equal(read.terrain.elevation, question.terrain.elevation)


def test_a_terrain_file_is_no_question(tmp_path):
    save_terrain(tmp_path / "ground.npz", make_terrain(waves))
    with pytest.raises(PlanningError, match="ground.npz holds no question for a path"):
        read_query(tmp_path / "ground.npz")
