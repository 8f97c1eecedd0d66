# SPDX-License-Identifier: Apache-2.0
"""Read-only arrays: nobody's own is changed, none is copied in vain."""

import numpy as np
import pytest

from rover_physics.numerics.read_only import freeze_array, is_frozen, seal_array


def test_an_array_or_view_of_one_that_somebody_may_write_into_is_copied():
    own = np.arange(6.0)
    view = own[:3]
    view.flags.writeable = False
    frozen, seen = freeze_array(own), freeze_array(view)
    own[0] = 9.0
    assert frozen[0] == seen[0] == 0.0 and own.flags.writeable and not is_frozen(view)
    with pytest.raises(ValueError, match="read-only"):
        frozen[0] = 1.0


def test_what_is_frozen_is_not_copied():
    frozen = freeze_array(np.arange(6.0))
    assert freeze_array(frozen) is frozen
    part = frozen[2:4]
    assert freeze_array(part) is part
    assert is_frozen(np.frombuffer(b"12345678", np.uint8))
    assert not is_frozen(np.frombuffer(bytearray(8), np.uint8))


def test_a_sealed_array_is_frozen_with_all_that_it_is_a_view_of():
    whole = np.arange(12.0)
    part = seal_array(whole.reshape(3, 4)[::-1])
    assert is_frozen(part) and not whole.flags.writeable
    assert freeze_array(part) is part
