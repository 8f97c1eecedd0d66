# SPDX-License-Identifier: Apache-2.0
"""Links: what they hold comes back, and damaged ones are refused by name."""

import base64
import json
import zlib
from dataclasses import asdict, replace

import pytest

from rover_physics.rover.rover_file import rover_to_dict
from rover_planner.errors import PlanningError
from rover_planner.viewer.pages.sharing import KEY, PageLink, read_link, write_link
from support.viewer.sessions import FAR, LSR1

LINK = PageLink(
    loaded=rover_to_dict(LSR1),
    rover=rover_to_dict(replace(LSR1, name="bob", friction=1.0 / 3.0)),
    ground="00ab12cd",
    start=(FAR[0] - 1.25, FAR[1], -0.1),
    goal=(1e-7, 3.0, 1e20),
    policy="servo",
    soil="dry_sand",
    path=3,
    time=12.5,
    layer="use of friction",
    heading=-90.0,
    joints={"arm_yaw": -1.0},
    along=True,
)


def pack(text: str) -> str:
    return f"{KEY}={base64.urlsafe_b64encode(zlib.compress(text.encode())).decode()}"


def test_a_link_gives_back_exactly_what_it_was_made_of():
    query = write_link(LINK)
    assert read_link(f"?{query}") == LINK and len(query) < 1500


@pytest.mark.parametrize("query", ["", "?", "?darkMode", "?rover=lsr1", f"?{KEY}="])
def test_other_addresses_are_no_links(query):
    assert read_link(query) is None


def change(**changes) -> str:
    """Return a link with other values, as a damaged program may write it."""
    return pack(json.dumps(asdict(LINK) | changes))


@pytest.mark.parametrize(
    ("query", "names"),
    [
        (change(time=float("inf")), "invalid: time"),
        (change(heading=720.0), "invalid: heading: .* less than or equal to 180"),
        (change(path=0), "invalid: path"),
        (change(start=[1.0, 2.0]), "invalid: start"),
        (change(colour="red"), "invalid: colour"),
        (f"{KEY}=AAAA", "damaged"),
        (f"{KEY}=%C3%A4", "damaged"),
        (pack("x" * 300_000), "cut off, or holds more than 200000"),
        (write_link(LINK)[:200], "cut off"),
        (pack("no JSON"), "invalid"),
    ],
)
def test_a_link_that_is_damaged_huge_or_has_an_invalid_value_is_refused_by_name(query, names):
    with pytest.raises(PlanningError, match=f"the link is {names}"):
        read_link(query)
