# SPDX-License-Identifier: Apache-2.0
"""Verdicts become diagnostics for people and strict JSON for programs."""

import math
from dataclasses import dataclass, field
from typing import Any

import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus

from msg_adapters.results.verdicts import report_to_json, verdict_to_diagnostics


@dataclass
class Verdict:
    """What the adapter asks of a verdict, with the entries it is to tell."""

    traversable: bool
    reason: str = ""
    has_warning: bool = False
    entries: dict[str, Any] = field(default_factory=dict)

    def summary(self):
        return self.entries

    def to_dict(self):
        return self.entries


def status_of(verdict):
    message = verdict_to_diagnostics(verdict, "lsr1", "map", Time(sec=5))
    assert message.header.frame_id == "map" and message.header.stamp.sec == 5
    assert len(message.status) == 1
    return message.status[0]


@pytest.mark.parametrize(
    ("verdict", "level", "text"),
    [
        (Verdict(True), DiagnosticStatus.OK, "traversable"),
        (Verdict(True, has_warning=True), DiagnosticStatus.WARN, "traversable"),
        (Verdict(False, "tilt 0.6 rad"), DiagnosticStatus.ERROR, "tilt 0.6 rad"),
        (Verdict(False, "tilt 0.6 rad", True), DiagnosticStatus.ERROR, "tilt 0.6 rad"),
    ],
)
def test_level_and_text_follow_the_verdict(verdict, level, text):
    status = status_of(verdict)
    assert isinstance(status.level, bytes) and status.level == level
    assert status.message == text and status.hardware_id == "lsr1" and status.name


def test_every_entry_becomes_a_key_and_a_value():
    entries = {
        "traversable": False,
        "code": "tilt",
        "first_failure": 7,
        "mismatch": {"rocker_left": 0.25},
        "goal": [1.0, None],
    }
    status = status_of(Verdict(False, "tilt 0.6 rad", entries=entries))
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
        report_to_json(Verdict(True, entries={"number": number}))
