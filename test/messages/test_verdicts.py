# SPDX-License-Identifier: Apache-2.0
"""A verdict is told whole: as a status for operators, as strict JSON for programs."""

import math

import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus

from msg_adapters.results.diagnostics import to_json, verdict_to_diagnostics


def test_every_entry_of_a_verdict_becomes_a_key_and_a_value():
    entries = {
        "traversable": False,
        "code": "tilt",
        "first_failure": 7,
        "mismatch": {"rocker_left": 0.25},
        "goal": [1.0, None],
    }
    message = verdict_to_diagnostics("error", "tilt 0.6 rad", entries, "lsr1", "map", Time(sec=5))
    assert message.header.frame_id == "map" and message.header.stamp.sec == 5
    (status,) = message.status
    assert status.level == DiagnosticStatus.ERROR and status.message == "tilt 0.6 rad"
    assert status.hardware_id == "lsr1" and status.name
    assert {entry.key: entry.value for entry in status.values} == {
        "traversable": "false",
        "code": "tilt",
        "first_failure": "7",
        "mismatch": '{"rocker_left": 0.25}',
        "goal": "[1.0, null]",
    }


@pytest.mark.parametrize("number", [math.nan, -math.inf])
def test_json_has_no_nan_and_no_infinity(number):
    with pytest.raises(ValueError):
        to_json({"number": number})
