# SPDX-License-Identifier: Apache-2.0
"""Measured angles and pose give the six contacts, and with them the ground under the rover."""

import numpy as np
import pytest

from rover_physics import judge_path
from rover_planner.maps.ground_beneath import Standing, find_ground_beneath
from rover_planner.maps.layers import CONTACT, FOOTPRINT
from rover_planner.parameters.traverse_server import TraverseServerParameters
from rover_planner.planning.answering.living_map import LivingMap
from rover_planner.planning.answering.map_keeper import MapKeeper
from support.grounds import make_terrain, raised, smooth, waves, with_std
from support.rovers import LSR1, M2020

SLOPE = make_terrain(lambda x, y: 0.2 * x - 0.15 * y + 3.0)


def standing_at(rover, terrain, pose):
    """Return what a rover that stands at a pose measures, from the model."""
    there = judge_path(rover, terrain, np.array([pose]))[0]
    assert there.settled[0]
    angles = np.array([*there.rocker_angle[0], *there.bogie_angle[0]])
    attitude = there.roll[0], there.pitch[0], pose[2]
    return Standing(np.array([*there.position[0], *attitude]), angles), there


@pytest.mark.parametrize("rover", [LSR1, M2020], ids=lambda rover: rover.name)
@pytest.mark.parametrize("yaw", [0.0, -2.5])
def test_the_contacts_of_a_settled_rover_lie_on_the_ground(rover, yaw):
    for ground, tolerance in ((SLOPE, 1e-4), (make_terrain(waves), 0.005)):
        standing, there = standing_at(rover, ground, (0.2, -0.3, yaw))
        contacts = find_ground_beneath(rover, standing).contacts
        on_ground = ground.elevation_at(contacts[:, 0], contacts[:, 1])
        # A wheel that leans touches with its edge, by half its width times the slope.
        edge = 0.5 * rover.wheel.width * 0.25
        np.testing.assert_allclose(contacts[:, 2], on_ground, atol=tolerance + edge)
        assert np.abs(contacts - there.contact_points[0]).max() < rover.wheel.radius


def blind_behind(ground, x):
    """Return a ground that is unknown up to x."""
    columns = ground.origin[0] + ground.resolution * np.arange(ground.elevation.shape[1])
    return raised(ground, np.s_[:, columns < x], np.nan)


def fill(living, standing, margin=0.0):
    patch, is_contact = find_ground_beneath(LSR1, standing).patch(living.grid, margin, 0.02)
    return living.fill(patch, is_contact, 5.0)


def filled(ground, margin=0.0, pose=(0.0, 0.0, 0.3)):
    standing, _ = standing_at(LSR1, ground, pose)
    living = LivingMap()
    living.replace(blind_behind(ground, 0.8), "elevation_cloud", 1.0)
    assert fill(living, standing, margin)
    return living


def test_a_rover_on_ground_it_never_saw_settles_where_it_stands():
    ground = smooth(0, half=3.0)
    standing, true = standing_at(LSR1, ground, (0.0, 0.0, 0.3))
    terrain = filled(ground).snapshot().terrain
    there = judge_path(LSR1, terrain, np.array([(0.0, 0.0, 0.3)]))[0]
    assert there.settled[0]
    np.testing.assert_allclose(there.position[0], true.position[0], atol=0.01)
    for name in ("roll", "pitch", "rocker_angle", "bogie_angle"):
        np.testing.assert_allclose(getattr(there, name)[0], getattr(true, name)[0], atol=0.03)


def test_filled_cells_say_so_and_seen_ones_stay():
    now = filled(SLOPE).snapshot()
    blind = blind_behind(SLOPE, 0.8).elevation
    is_filled = np.isnan(blind) & np.isfinite(now.terrain.elevation)
    assert set(np.unique(now.sources.source[is_filled])) == {CONTACT, FOOTPRINT}
    assert (now.sources.time[is_filled] == 5.0).all()
    seen = np.isfinite(blind)
    np.testing.assert_array_equal(now.terrain.elevation[seen], blind[seen])
    np.testing.assert_allclose(
        now.terrain.elevation[is_filled], SLOPE.elevation[is_filled], atol=0.012
    )
    contacts = (now.sources.source == CONTACT).sum()
    assert 6 <= contacts < 0.3 * is_filled.sum()


def test_the_margin_continues_the_ground_around_the_wheels_where_the_rover_starts_alone():
    keeper = MapKeeper(LSR1, TraverseServerParameters(footprint_margin=0.2))
    start, further = (standing_at(LSR1, SLOPE, (x, 0.0, 0.3))[0] for x in (-2.2, -0.5))
    first = keeper.take(blind_behind(SLOPE, 0.8), "elevation_cloud", 1.0, start)
    then = keeper.fill(further, 2.0)
    there, both = (
        np.isin(one.sources.source, (CONTACT, FOOTPRINT)).sum() for one in (first, then)
    )
    # The wheels' outline of lsr1 is 1.0 m x 0.7 m; interpolation needs 1.5 cells around it.
    assert there * 0.05**2 == pytest.approx(1.55 * 1.25, rel=0.05)
    assert (both - there) * 0.05**2 == pytest.approx(1.15 * 0.85, rel=0.05)


def test_a_contact_replaces_what_was_assumed_and_a_map_replaces_both():
    living = filled(SLOPE, margin=0.5)
    first = living.snapshot()
    standing, _ = standing_at(LSR1, SLOPE, (0.02, 0.1, 0.3))
    assert fill(living, standing)
    second = living.snapshot()
    turned = (first.sources.source == FOOTPRINT) & (second.sources.source == CONTACT)
    assert turned.any()
    assert not ((first.sources.source == CONTACT) & (second.sources.source != CONTACT)).any()
    living.merge(SLOPE, "elevation_cloud", 2.0)
    np.testing.assert_array_equal(living.snapshot().terrain.elevation, SLOPE.elevation)


def test_filled_heights_are_uncertain_on_an_uncertain_map_only():
    assert filled(SLOPE).snapshot().terrain.elevation_std is None
    std = filled(with_std(SLOPE, 0.001)).snapshot()
    is_filled = np.isin(std.sources.source, (CONTACT, FOOTPRINT))
    assert (std.terrain.elevation_std[is_filled] == 0.02).all()
