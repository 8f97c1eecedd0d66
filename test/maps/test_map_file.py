# SPDX-License-Identifier: Apache-2.0
"""load_map reads terrain files below its folder and within its limits, and nothing else."""

import os

import numpy as np
import pytest

from rover_physics import save_terrain
from rover_physics.errors import TerrainError
from rover_planner.maps.map_file import MapFileError, open_map
from support.grounds import make_terrain, waves


@pytest.fixture
def maps(tmp_path):
    """Return a folder of maps; beside it is a map that is not below it."""
    for name in ("maps/site", "maps/site 2", "elsewhere"):
        (tmp_path / name).mkdir(parents=True)
    for name in ("maps/a.npz", "maps/site/b.npz", "maps/site 2/c.npz", "elsewhere/d.npz"):
        save_terrain(tmp_path / name, make_terrain(waves))
    return tmp_path / "maps"


def load(maps, name, **limits):
    return open_map(name, str(maps), **limits)


def test_a_path_and_a_url_below_the_folder_are_read(maps):
    expected = make_terrain(waves).elevation
    for url in (
        f"{maps}/a.npz",
        f"file://{maps}/a.npz",
        f"file://localhost{maps}/site/b.npz",
        f"file:{maps}/site/../a.npz",
        f"file://{maps}/site%202/c.npz",
        f"{maps}/site 2/c.npz",
    ):
        np.testing.assert_array_equal(load(maps, url).elevation, expected)


def test_a_relative_path_starts_at_the_folder_which_may_be_one_of_the_user(maps, monkeypatch):
    monkeypatch.setenv("HOME", str(maps.parent))
    assert load("~/maps", "site/../a.npz").elevation.size
    with pytest.raises(MapFileError, match="not below"):
        load("~/maps", "../elsewhere/d.npz")


def test_a_file_beside_the_folder_is_refused(maps):
    beside = maps.parent / "elsewhere" / "d.npz"
    (maps.parent / "maps2").mkdir()
    save_terrain(maps.parent / "maps2" / "e.npz", make_terrain(waves))
    for url in (beside, f"file://{beside}", f"{maps}/../elsewhere/d.npz", f"{maps}2/e.npz",
                f"file://{maps}/%2e%2e/elsewhere/d.npz", "/etc/passwd"):  # fmt: skip
        with pytest.raises(MapFileError, match=r"not below .*maps, the folder of maps"):
            load(maps, str(url))


def test_a_link_inside_the_folder_is_followed_and_one_out_of_it_refused(maps):
    (maps / "relative.npz").symlink_to("site/b.npz")
    (maps / "outer.npz").symlink_to(maps.parent / "elsewhere" / "d.npz")
    (maps / "outside").symlink_to(maps.parent / "elsewhere")
    assert load(maps, f"{maps}/relative.npz").elevation.size
    for name in ("outer.npz", "outside/d.npz"):
        with pytest.raises(MapFileError, match="not below"):
            load(maps, f"{maps}/{name}")


@pytest.mark.parametrize("part", ["site/b.npz", "site"])
def test_a_link_that_replaces_a_part_after_the_check_is_not_followed(maps, monkeypatch, part):
    """The race of a client that exchanges a file or folder while it is being opened."""
    elsewhere = maps.parent / "elsewhere"
    os.rename(elsewhere / "d.npz", elsewhere / "b.npz")
    resolve = os.path.realpath

    def resolve_and_exchange(name, **options):
        resolved = resolve(name, **options)
        if str(name).endswith("b.npz"):
            os.rename(maps / part, maps / "gone")
            target = elsewhere / "b.npz" if part.endswith("npz") else elsewhere
            (maps / part).symlink_to(target)
        return resolved

    monkeypatch.setattr(os.path, "realpath", resolve_and_exchange)
    with pytest.raises(MapFileError, match="not below"):
        load(maps, f"{maps}/site/b.npz")


@pytest.mark.parametrize(
    "url",
    ["", "//[", "http://a/b.npz", "file://host/a.npz", "file://[::1", "u" * 5000, "file:///%00",
     "\n", "file:///%ff", "\udcff", "a\0b", "spirit", "/", "/dev/zero"],
    ids=lambda url: ascii(url[:20]),
)  # fmt: skip
def test_what_names_no_file_is_refused_in_one_short_line(url):
    with pytest.raises(MapFileError) as raised:
        open_map(url)
    assert len(str(raised.value)) <= 400
    assert str(raised.value).isprintable()


def test_a_file_above_a_limit_is_refused_by_the_parameters_name(maps):
    size = (maps / "a.npz").stat().st_size
    cells = make_terrain(waves).elevation.size
    with pytest.raises(TerrainError, match=r"the limit \(max_map_bytes\) is"):
        load(maps, f"{maps}/a.npz", max_bytes=size - 1)
    with pytest.raises(TerrainError, match=f"the limit is {cells - 1}"):
        load(maps, f"{maps}/a.npz", max_cells=cells - 1)
    assert load(maps, f"{maps}/a.npz", max_bytes=size, max_cells=cells).elevation.size == cells
