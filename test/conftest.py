"""What all tests share: the real maps, and a ROS that stays on this machine."""

import os
from pathlib import Path

import pytest

os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"


@pytest.fixture(scope="session")
def terrain_dir() -> Path:
    """Return the folder of real elevation maps, which are not part of the package."""
    beside = Path(__file__).resolve().parents[2] / "shared" / "terrain"
    folder = Path(os.environ.get("ROVER_TERRAIN_DIR", beside))
    if not folder.is_dir():
        pytest.skip(f"no real maps in {folder}; set ROVER_TERRAIN_DIR to their folder")
    return folder
