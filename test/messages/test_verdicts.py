"""Verdicts become diagnostics for people and strict JSON for programs."""

import json
import math

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus

from msg_adapters.verdicts import verdict_to_diagnostics, verdict_to_json

GOOD = {"traversable": True, "code": "", "reason": "", "min_tip_over_ratio": 0.8}
BAD = {"traversable": False, "code": "tilt", "reason": "tilt 0.6 rad", "first_failure": 7}


def status_of(verdict, **arguments):
    message = verdict_to_diagnostics(verdict, "lsr1", "map", Time(sec=5), **arguments)
    assert message.header.frame_id == "map" and message.header.stamp.sec == 5
    assert len(message.status) == 1
    return message.status[0]


@pytest.mark.parametrize(
    ("verdict", "warn", "level", "text"),
    [
        (GOOD, False, DiagnosticStatus.OK, "traversable"),
        (GOOD, True, DiagnosticStatus.WARN, "traversable"),
        (BAD, False, DiagnosticStatus.ERROR, "tilt 0.6 rad"),
        (BAD, True, DiagnosticStatus.ERROR, "tilt 0.6 rad"),
    ],
)
def test_level_and_text_follow_the_verdict(verdict, warn, level, text):
    status = status_of(verdict, warn=warn)
    assert isinstance(status.level, bytes) and status.level == level
    assert status.message == text and status.hardware_id == "lsr1" and status.name


def test_every_entry_but_those_per_waypoint_becomes_a_key_and_a_value():
    verdict = BAD | {
        "codes": ["", "tilt"],
        "mismatch": {"rocker_left": np.float64(0.25)},
        "goal": [1.0, math.nan],
    }
    values = {entry.key: entry.value for entry in status_of(verdict).values}
    assert values == {
        "traversable": "false",
        "code": "tilt",
        "reason": "tilt 0.6 rad",
        "first_failure": "7",
        "mismatch": '{"rocker_left": 0.25}',
        "goal": "[1.0, null]",
    }


def test_json_opens_with_the_verdict_and_ends_with_the_long_lists():
    verdict = {"codes": ["", "tilt"], "min_tip_over_ratio": 0.8, "reasons": ["", "x"]} | BAD
    names = list(json.loads(verdict_to_json(verdict)))
    assert names[:3] == ["traversable", "code", "reason"]
    assert set(names[-2:]) == {"codes", "reasons"}
    assert set(names) == set(verdict)


def test_json_is_strict_whatever_the_numbers():
    text = verdict_to_json(
        GOOD
        | {
            "nan": math.nan,
            "infinite": np.float64(-math.inf),
            "flag": np.bool_(True),
            "count": np.int64(3),
            "row": np.array([[1.0, np.nan]]),
            "pair": (1, 2),
        }
    )
    assert "\n" not in text

    def refuse(constant):
        raise AssertionError(f"{constant} is not JSON")

    read = json.loads(text, parse_constant=refuse)
    assert read == GOOD | {
        "nan": None,
        "infinite": None,
        "flag": True,
        "count": 3,
        "row": [[1.0, None]],
        "pair": [1, 2],
    }
