# SPDX-License-Identifier: Apache-2.0
"""Links: what they hold comes back, and damaged ones are refused by name."""

from dataclasses import replace

import numpy as np
import pytest

from rover_physics.rover.rover_file import load_rover
from rover_planner.errors import PlanningError
from rover_planner.studies.rover_values import read_rover, write_rover
from rover_planner.viewer.state.link import (
    PageLink,
    change_values,
    list_changed_values,
    pack_text,
    read_link,
    write_link,
)
from support.viewer.sessions import FAR

LINK = PageLink(
    rover="lsr1",
    ground="00ab12cd",
    start=(FAR[0] - 1.25, FAR[1], -0.1),
    goal=(1e-7, 3.0, 1e20),
    policy="servo",
    soil="dry_sand",
    path=3,
    time=12.5,
    layer="friction utilisation",
    heading=-90.0,
    values={"body centre x [m]": -0.05, "friction [-]": 0.5},
    joints={"arm_yaw": -1.0},
    along=True,
    rover_file="name: bob\nfriction: 0.5  # \u03bc\n",
)


def test_a_link_gives_back_what_it_was_made_of():
    assert read_link("?" + write_link(LINK)) == LINK
    # as a browser writes it anew
    spaced = write_link(LINK).replace("+", "%20").replace("%2C", ",")
    assert read_link(spaced) == LINK


@pytest.mark.parametrize("query", ["", "?", "?darkMode", "?rover=lsr1", "?map=1"])
def test_other_addresses_are_no_links(query):
    assert read_link(query) is None


@pytest.mark.parametrize(
    ("old", "new", "names"),
    [
        ("time=12.5", "time=soon", "time of the link is 'soon'"),
        ("time=12.5", "time=inf", "time of the link is 'inf'"),
        ("&goal=", "&gaol=", "the link has no goal"),
        ("heading=-90.0", "heading=", "heading of the link is ''"),
        ("start=", "start=1%2C", "start of the link is"),
        ("path=3", "path=0", "path of the link is '0'; it must be 1, 2, 3"),
        ("heading=-90.0", "heading=720", "heading of the link is '720'; it must be -180"),
    ],
)
def test_a_damaged_link_is_refused_by_name(old, new, names):
    query = write_link(LINK)
    assert old in query
    with pytest.raises(PlanningError, match=names.replace("(", r"\(")):
        read_link(query.replace(old, new))


def test_changed_numbers_of_a_rover_come_back_by_their_labels():
    loaded = load_rover("lsr1")
    values = {"friction [-]": 0.5, "wheels z [m]": -0.21, "body centre x [m]": -0.05}
    assert list_changed_values(loaded, change_values(loaded, values)) == values
    assert list_changed_values(loaded, loaded) == {}
    with pytest.raises(PlanningError, match="'wings', which lsr1 does not have"):
        change_values(loaded, {"wings": 2.0})


def test_a_rover_of_a_file_comes_back_from_a_link_exactly():
    rover = replace(load_rover("lsr1"), name="bob", friction=1.0 / 3.0)
    query = write_link(replace(LINK, rover_file=write_rover(rover)))
    assert len(query) < 1500
    assert read_rover(read_link(query).rover_file, "link") == rover


def test_a_rover_file_that_is_too_large_for_a_link_is_refused_with_what_to_do():
    letters = "".join(chr(33 + k % 90) for k in np.random.default_rng(1).integers(0, 90, 20_000))
    with pytest.raises(PlanningError, match="of lsr1; an address holds 8000. Save the rover file"):
        write_link(replace(LINK, rover_file=letters))


@pytest.mark.parametrize(
    ("packed", "names"),
    [("AAAA", "damaged"), ("%C3%A4", "damaged"), (pack_text("x" * 300_000), "larger than 200000")],
)
def test_a_damaged_or_huge_rover_file_in_a_link_is_refused(packed, names):
    query = write_link(replace(LINK, rover_file=""))
    with pytest.raises(PlanningError, match=names):
        read_link(f"{query}&rover_file={packed}")
