# SPDX-License-Identifier: Apache-2.0
"""Files that users name: only regular files of limited size are read, and nothing waits."""

import os
import time

import pytest

from rover_physics.errors import RoverError, RoverFileError
from rover_physics.files.user_file import read_regular_file, write_file
from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.grid import load_terrain
from rover_planner.command.prediction_files import read_poses, read_prediction
from rover_planner.errors import PlanningError
from rover_planner.studies.study_file import load_study
from support.hostile_files import make_oddities

KINDS = {
    "pipe": "a named pipe",
    "folder": "a directory",
    "socket": "a socket",
    "to_zero": "a device",
    "loop": "Too many levels of symbolic links",
    "dangling": "No such file",
}
READERS = (load_rover, load_study, load_terrain, read_poses, read_prediction)


@pytest.fixture
def oddities(tmp_path):
    """Return a folder with things that are no regular files, and their names."""
    return tmp_path, make_oddities(tmp_path)


@pytest.mark.parametrize("name", KINDS)
def test_what_is_no_regular_file_is_refused_with_its_kind(oddities, name):
    with pytest.raises(RoverFileError, match=KINDS[name]):
        read_regular_file(oddities[0] / name, 1000)


@pytest.mark.parametrize("read", READERS, ids=lambda read: read.__name__)
def test_no_reader_waits_for_a_pipe_or_reads_a_device(oddities, read, monkeypatch):
    monkeypatch.chdir(oddities[0])  # a relative name means nothing there
    for name in oddities[1]:
        began = time.perf_counter()
        with pytest.raises((RoverError, PlanningError)) as raised:
            read(oddities[0].__class__(name))
        assert time.perf_counter() - began < 20.0, name
        assert len(str(raised.value)) <= 400
        assert str(raised.value).isprintable()


def test_a_file_above_the_limit_is_refused_even_if_the_system_does_not_know_its_size(tmp_path):
    path = tmp_path / "file"
    path.write_bytes(b"x" * 1000)
    assert read_regular_file(path, 1000) == b"x" * 1000
    assert os.stat("/proc/self/maps").st_size == 0
    for name, most in ((path, 999), ("/proc/self/maps", 100)):
        with pytest.raises(RoverFileError, match=f"larger than {most} bytes"):
            read_regular_file(name, most)


def test_a_file_without_permission_is_refused(tmp_path):
    path = tmp_path / "file"
    path.write_bytes(b"x")
    path.chmod(0)
    if os.access(path, os.R_OK):
        pytest.skip("this user may read every file")
    with pytest.raises(RoverFileError, match="Permission denied"):
        read_regular_file(path, 10)


def test_writing_to_a_pipe_without_reader_a_full_disk_or_a_folder_is_refused(oddities):
    for name, reason in [
        (oddities[0] / "pipe", "No such device"),
        (oddities[0] / "folder", "Is a directory"),
        (oddities[0] / "no" / "file", "No such file"),
        ("/dev/full", "No space left"),
        ("x" * 300, "File name too long"),
    ]:
        with pytest.raises(RoverFileError, match=f"cannot be written: {reason}"):
            write_file(name, b"content")
