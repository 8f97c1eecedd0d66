# SPDX-License-Identifier: Apache-2.0
"""Contact: a wheel's gap is the smallest over its lower half, and it touches where that is."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from rover_physics.contact.contact_record import SearchScope
from rover_physics.contact.wheel import blend_contact, find_contact
from rover_physics.contact.wheel_samples import sample_wheel
from rover_physics.prediction.evaluation import new_work
from rover_physics.prediction.packed_model import pack_model
from rover_physics.rover.linkage import place
from rover_physics.rover.rover_file import load_rover
from rover_physics.status import ContactStatus
from rover_physics.terrain.grid import Terrain
from support.rough_grounds import RESOLUTION, fractal, plane, rocky, smooth
from support.rover_geometry import wheel_gap

LSR1 = load_rover("lsr1")
RADIUS, WIDTH = LSR1.wheel.radius, LSR1.wheel.width
few = settings(max_examples=30)


class WheelOn:
    """The first wheel of a rover, put with its centre somewhere over a ground."""

    def __init__(self, ground: Terrain, centre, scope, roll=0.0, pitch=0.0, yaw=0.0):
        self.model = pack_model(LSR1, ground)
        self.work = new_work()
        self.samples, self.contacts = self.model.record.samples, self.work.contacts
        self.placement = self.work.placement
        q = np.array([0.0, roll, pitch, 0.0, 0.0, 0.0])
        place(self.model.record.linkage, np.array([0.0, 0.0, yaw]), q, self.placement)
        self.placement.centres[0] = centre
        for step in (SearchScope.QUICK, scope):
            self.status = find_contact(self.model.record, self.work, 0, step)

    @property
    def gap(self) -> float:
        return self.contacts.gap[0]

    @property
    def angle(self) -> float:
        return np.arctan2(self.contacts.sine[0], self.contacts.cosine[0])

    def share(self) -> "WheelOn":
        """Let the circles that are nearly as near share the load."""
        blend_contact(self.model.record, self.work, 0)
        return self


@pytest.mark.parametrize("scope", [SearchScope.FULL, SearchScope.WHOLE])
@pytest.mark.parametrize("height", [0.05, 0.10, 0.30])
def test_over_level_ground_the_gap_is_the_height_less_the_radius(scope, height):
    wheel = WheelOn(plane(0.0, 0.0, height=0.4), [0.013, -0.007, 0.4 + height], scope)
    assert wheel.status == ContactStatus.IN_CONTACT
    assert wheel.gap == pytest.approx(height - RADIUS, abs=1e-12)
    assert wheel.angle == pytest.approx(0.0, abs=1e-6)


@few
@given(st.floats(-0.8, 0.8), st.floats(-np.pi, np.pi))
def test_on_a_plane_the_contact_angle_is_the_slope_along_the_heading(slope, yaw):
    along = np.arctan(slope * np.cos(yaw))
    cross = np.arctan(slope * np.sin(yaw) * np.cos(along))
    attitude = Rotation.from_euler("ZYX", [yaw, -along, -cross])
    normal = np.array([-slope, 0.0, 1.0]) / np.hypot(slope, 1.0)
    assert attitude.apply([0.0, 0.0, 1.0]) == pytest.approx(normal)
    wheel = WheelOn(
        plane(slope, 0.0), normal * RADIUS, SearchScope.FULL, -cross, -along, yaw
    ).share()
    assert wheel.gap == pytest.approx(0.0, abs=1e-8)
    assert wheel.contacts.point[0] == pytest.approx([0.0, 0.0, 0.0], abs=1e-6)
    below = attitude.as_matrix()[:, 1]
    ahead = np.cross(below, [0.0, 0.0, 1.0])
    assert np.sin(wheel.angle) == pytest.approx(-normal @ ahead / np.linalg.norm(ahead), abs=1e-6)


@pytest.mark.parametrize(("roll", "side"), [(0.2, -1.0), (-0.2, 1.0)])
def test_a_leaning_wheel_stands_on_its_lower_edge(roll, side):
    wheel = WheelOn(plane(0.0, 0.0), [0.0, 0.0, 0.2], SearchScope.FULL, roll=roll).share()
    lowest = RADIUS * np.cos(roll) + 0.5 * WIDTH * np.sin(abs(roll))
    assert wheel.gap == pytest.approx(0.2 - lowest, abs=1e-9)
    across = RADIUS * np.sin(roll) + side * 0.5 * WIDTH * np.cos(roll)
    assert wheel.contacts.point[0, 1] == pytest.approx(across, abs=1e-9)


def block(height: float) -> Terrain:
    """Return level ground with a block of `height` [m] from x = 0 on."""
    x = (np.arange(241) - 120) * 0.005
    profile = np.where(x >= 0.0, height, 0.0)
    return Terrain(np.broadcast_to(profile, (61, 241)), 0.005, (x[0], -0.15))


@pytest.mark.parametrize(
    ("distance", "yaw"), [(0.02, 0.0), (0.05, 0.0), (0.08, 0.0), (0.05, np.pi)]
)
def test_before_or_behind_an_edge_the_wheel_rests_on_the_edge(distance, yaw):
    wheel = WheelOn(block(0.06), [-distance, 0.0, 0.3], SearchScope.FULL, yaw=yaw)
    above = 0.06 + np.sqrt(RADIUS**2 - distance**2)
    assert wheel.gap == pytest.approx(0.3 - above, abs=2e-4)
    assert wheel.angle == pytest.approx(np.cos(yaw) * np.arcsin(distance / RADIUS), abs=5e-3)


@few
@given(
    st.sampled_from([smooth, fractal, rocky]),
    st.integers(0, 30),
    st.floats(-0.4, 0.4),
    st.floats(-0.4, 0.4),
    st.floats(-np.pi, np.pi),
)
def test_the_gap_is_the_smallest_over_the_whole_width(make, seed, roll, pitch, yaw):
    ground = make(seed)
    x, y = np.random.default_rng(seed).uniform(-1.0, 1.0, 2)
    centre = [x, y, float(ground.elevation_at(x, y)) + RADIUS]
    wheel = WheelOn(ground, centre, SearchScope.WHOLE, roll, pitch, yaw)
    axis = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix()[:, 1]
    assert wheel.gap == pytest.approx(wheel_gap(LSR1, ground, np.array(centre), axis), abs=1e-4)


def test_a_peak_between_the_circles_is_found_wherever_it_is():
    for aside in np.linspace(-0.45 * WIDTH, 0.45 * WIDTH, 19):
        heights = np.zeros((101, 101))
        heights[50, 50] = 0.03
        ground = Terrain(heights, 0.01, (-0.5, -0.5 - aside))
        wheel = WheelOn(ground, [0.0, 0.0, 0.2], SearchScope.WHOLE)
        assert wheel.gap == pytest.approx(0.2 - RADIUS - 0.03, abs=1e-5)
        assert wheel.contacts.across[0] == pytest.approx(-aside, abs=1e-6)


@few
@given(st.integers(0, 30), st.floats(-0.4, 0.4), st.floats(-np.pi, np.pi))
def test_the_touching_point_is_on_the_rim_and_in_the_gap_to_a_tenth_of_a_millimetre(
    seed, roll, yaw
):
    ground = fractal(seed)
    wheel = WheelOn(ground, [0.1, 0.2, 0.5], SearchScope.FULL, roll, 0.0, yaw)
    point, axis = wheel.contacts.point[0], wheel.placement.R[:, 1]
    arm = point - [0.1, 0.2, 0.5]
    assert np.linalg.norm(arm - (arm @ axis) * axis) == pytest.approx(RADIUS, abs=1e-12)
    assert abs(arm @ axis) <= 0.5 * WIDTH + 1e-12
    height = float(ground.elevation_at(point[0], point[1]))
    assert point[2] - height == pytest.approx(wheel.gap, abs=1e-4)


@few
@given(st.integers(0, 30), st.floats(-1e-3, 1e-3))
def test_the_normal_says_how_the_gap_changes_sideways(seed, step):
    ground = smooth(seed)
    here = WheelOn(ground, [0.1, 0.2, 0.3], SearchScope.FULL)
    there = WheelOn(ground, [0.1 + step, 0.2, 0.3], SearchScope.FULL)
    assert there.gap - here.gap == pytest.approx(here.contacts.normal[0, 0] * step, abs=5e-6)


@pytest.mark.parametrize("scope", [SearchScope.FULL, SearchScope.WHOLE])
def test_unknown_ground_and_the_map_edge_are_told_apart(scope):
    ground = plane(0.0, 0.0)
    heights = ground.elevation.copy()
    heights[:, heights.shape[1] // 2 + 10] = np.nan
    holed = Terrain(heights, ground.resolution, ground.origin)
    for where, x, status in (
        (holed, 0.0, ContactStatus.IN_CONTACT),
        (holed, 10 * RESOLUTION - 0.12, ContactStatus.UNKNOWN_GROUND),
        (holed, 10 * RESOLUTION, ContactStatus.UNKNOWN_GROUND),
        (ground, ground.bounds[1] - 0.09, ContactStatus.OFF_MAP),
    ):
        assert WheelOn(where, [x, 0.0, 0.1], scope).status == status, x
    assert np.isnan(WheelOn(ground, [ground.bounds[1] + 5.0, 0.0, 0.1], scope).gap)


@pytest.mark.parametrize("resolution", [0.005, 0.02, 0.05, 0.2])
def test_samples_span_the_wheel_and_are_as_dense_as_the_cells_or_enough(resolution):
    samples = sample_wheel(LSR1, resolution)
    angles = np.arctan2(samples.sines, samples.cosines)[: samples.rows]
    laterals = samples.laterals[: samples.circles]  # of the circles across the width
    assert angles[[0, -1]] == pytest.approx([-0.5 * np.pi, 0.5 * np.pi])
    assert laterals[[0, -1]] == pytest.approx([-0.5 * WIDTH, 0.5 * WIDTH])
    assert laterals.size >= 3
    assert laterals[laterals.size // 2] == 0.0
    assert RADIUS * np.diff(angles).max() <= max(resolution, 0.01)
