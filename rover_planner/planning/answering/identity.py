# SPDX-License-Identifier: Apache-2.0
"""Tells what an answer is about: the question, the path and the map."""

import secrets
from dataclasses import dataclass, field

from rover_planner.maps.known_map import stamp_text
from rover_planner.planning.answering.situation import Situation
from rover_planner.planning.verdict_report import IdentityReport


@dataclass
class Register:
    """Numbers the questions of a server."""

    server: str = field(default_factory=lambda: secrets.token_hex(4))
    """Random text of this run of the server."""
    count: int = 0
    """Number of the last question."""

    def next_number(self) -> int:
        """Return the number of a new question, one above the last."""
        self.count += 1
        return self.count

    def identify(
        self, number: int, service: str, question_hash: str, situation: Situation
    ) -> IdentityReport:
        """Return what the answer to a question is about, without its path.

        Args:
            number: Number of the question.
            service: Name of the service that was called.
            question_hash: Hash of the request.
            situation: What was known when it was asked.
        """
        known = situation.known_map
        return IdentityReport(
            request=number,
            service=service,
            server=self.server,
            question_hash=question_hash,
            path_hash="",
            path_stamp="",
            map_hash="" if known is None else known.fingerprint,
            map_stamp="" if known is None else stamp_text(known.stamp),
            map_age=situation.map_age,
        )
