# SPDX-License-Identifier: Apache-2.0
"""Contact: a wheel's gap is the smallest over its lower half, and it touches where that is.

Whole rovers are looked at in test_settling.py.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from rover_physics.contact.contact_record import SearchScope
from rover_physics.contact.wheel import blend_contact, find_contact
from rover_physics.prediction.evaluation import new_work
from rover_physics.prediction.packed_model import pack_model
from rover_physics.rover.linkage import place
from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.grid import Terrain
from support.rough_grounds import fractal, plane, rocky, smooth
from support.rover_geometry import wheel_gap

pytestmark = pytest.mark.long  # the kernels of one wheel compile apart from those of a pose
LSR1 = load_rover("lsr1")
RADIUS, WIDTH = LSR1.wheel.radius, LSR1.wheel.width
few = settings(max_examples=30)


class WheelOn:
    """The first wheel of a rover, put with its centre somewhere over a ground."""

    def __init__(self, ground: Terrain, centre, scope, roll=0.0, pitch=0.0, yaw=0.0):
        self.model = pack_model(LSR1, ground)
        self.work = new_work()
        self.contacts, self.placement = self.work.contacts, self.work.placement
        q = np.array([0.0, roll, pitch, 0.0, 0.0, 0.0])
        place(self.model.record.linkage, np.array([0.0, 0.0, yaw]), q, self.placement)
        self.placement.centres[0] = centre
        for step in (SearchScope.QUICK, scope):
            find_contact(self.model.record, self.work, 0, step)

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
@given(st.integers(0, 30), st.floats(-1e-3, 1e-3))
def test_the_normal_says_how_the_gap_changes_sideways(seed, step):
    ground = smooth(seed)
    here = WheelOn(ground, [0.1, 0.2, 0.3], SearchScope.FULL)
    there = WheelOn(ground, [0.1 + step, 0.2, 0.3], SearchScope.FULL)
    assert there.gap - here.gap == pytest.approx(here.contacts.normal[0, 0] * step, abs=5e-6)
