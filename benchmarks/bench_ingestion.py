"""Times a map message of a million points, until the first query can be answered from it."""

import array
import time

import numpy as np
from sensor_msgs.msg import PointCloud2

from benchmarks.measure import Figure, median_times
from msg_adapters.elevation import terrain_from_point_cloud, terrain_to_point_cloud
from rover_physics.terrain.grid import Terrain
from rover_planner.parameters.traverse_server import TraverseServerParameters
from rover_planner.planning.answering.service_settings import load_service_settings
from rover_planner.planning.answering.traverse_service import TraverseService
from rover_planner.worlds.mars_terrain import make_mars_terrain

CELLS = 1_000
"""Cells along each side of the map."""
RESOLUTION = 0.05
"""Cell size [m]."""
"""Cell size [m]."""


def make_map() -> Terrain:
    """Return a map with gaps like those in sensor data."""
    ground = make_mars_terrain(2, CELLS * RESOLUTION, RESOLUTION)
    elevation = ground.elevation[:CELLS, :CELLS].copy()
    elevation[np.random.default_rng(0).random(elevation.shape) < 0.02] = np.nan
    return Terrain(elevation, RESOLUTION, ground.origin)


def scatter(cloud: PointCloud2) -> PointCloud2:
    """Return the cloud with its points shuffled and moved off their cell centres."""
    rng = np.random.default_rng(1)
    points = rng.permutation(np.frombuffer(cloud.data, "<f4").reshape(-1, 3))
    points[:, :2] += rng.uniform(-0.5 * RESOLUTION, 0.5 * RESOLUTION, (len(points), 2))
    mixed = PointCloud2(height=1, width=len(points), point_step=12, row_step=12 * len(points))
    mixed.header, mixed.fields = cloud.header, cloud.fields
    mixed.data = array.array("B", points.astype("<f4").tobytes())
    return mixed


def measure() -> list[Figure]:
    """Measure a cloud ordered by rows and a cloud in random order."""
    settings = load_service_settings(TraverseServerParameters())
    service = TraverseService(settings)
    cloud = terrain_to_point_cloud(make_map(), "map")
    scattered = scatter(cloud)

    def take_rows() -> None:
        service.take_terrain(terrain_from_point_cloud(cloud))

    def take_scattered() -> None:
        service.take_terrain(terrain_from_point_cloud(scattered, RESOLUTION))

    rows, mixed = median_times([take_rows, take_scattered], 9, time.perf_counter)
    return [
        Figure(
            "map message", "1,000 x 1,000 points row by row", 1e3 * rows, "ms", 30.0, repeats=9
        ),
        Figure("map message", "a million scattered points", 1e3 * mixed, "ms", repeats=9),
    ]
