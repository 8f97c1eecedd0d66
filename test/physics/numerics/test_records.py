# SPDX-License-Identifier: Apache-2.0
"""Records: an array that shares one follows it, a copy does not."""

import numpy as np

from rover_physics.numerics.records import array_of, new_record, record_type, shared_array_of

KIND = record_type(("number", float), ("row", float, (3,)))


def test_a_shared_array_is_the_record_and_a_copy_is_not():
    record = new_record(KIND, number=1.0)
    shared, copied = shared_array_of(record), array_of(record)
    record.number = 2.0
    assert shared["number"].tolist() == [2.0] and copied["number"].tolist() == [1.0]


def test_a_record_among_others_is_copied_alone():
    records = np.zeros(3, KIND)
    records["number"] = 1.0, 2.0, 3.0
    assert shared_array_of(records[1])["number"].tolist() == [2.0]
