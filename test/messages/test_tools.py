"""Tool targets and wrenches are understood in the map frame, or refused by name."""

import numpy as np
import pytest

from msg_adapters.errors import MessageError
from msg_adapters.tools import target_to_point, wrench_to_force_and_moment
from support.messages.tool_messages import make_target, make_wrench


def test_a_target_is_its_place():
    np.testing.assert_array_equal(target_to_point(make_target(), "map"), [1.0, 2.0, 0.3])


def test_a_wrench_is_force_and_moment():
    force, moment = wrench_to_force_and_moment(make_wrench(), "map")
    np.testing.assert_array_equal(force, [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(moment, [4.0, 5.0, 6.0])


@pytest.mark.parametrize(
    ("target", "text"),
    [
        (make_target(frame="odom"), "tool target is in frame 'odom'"),
        (make_target(frame=""), "without a frame_id"),
        (make_target(z=float("nan")), "tool target is [1.0, 2.0, nan]"),
    ],
)
def test_a_bad_target_is_refused_by_name(target, text):
    with pytest.raises(MessageError) as error:
        target_to_point(target, "map")
    assert text in str(error.value)


@pytest.mark.parametrize(
    ("wrench", "text"),
    [
        (make_wrench(frame="base_link"), "tool wrench is in frame 'base_link'"),
        (make_wrench(force=(0.0, float("inf"), 0.0)), "tool wrench force"),
        (make_wrench(moment=(0.0, float("nan"), 0.0)), "tool wrench torque"),
    ],
)
def test_a_bad_wrench_is_refused_by_name(wrench, text):
    with pytest.raises(MessageError) as error:
        wrench_to_force_and_moment(wrench, "map")
    assert text in str(error.value)
