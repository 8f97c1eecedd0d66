# SPDX-License-Identifier: Apache-2.0
"""Read-only arrays: nobody's own is changed, none is copied in vain."""

import numpy as np

from rover_physics.numerics.read_only import freeze_array, is_frozen, seal_array


def test_an_array_or_view_of_one_that_somebody_may_write_into_is_copied():
    own = np.arange(6.0)
    view = own[:3]
    view.flags.writeable = False
    frozen, seen = freeze_array(own), freeze_array(view)
    own[0] = 9.0
    assert frozen[0] == seen[0] == 0.0 and own.flags.writeable
    assert is_frozen(frozen) and not is_frozen(view)
    assert not is_frozen(np.frombuffer(bytearray(8), np.uint8))


def test_what_is_frozen_or_sealed_with_all_that_it_is_a_view_of_is_not_copied():
    whole = np.arange(12.0)
    sealed = seal_array(whole.reshape(3, 4)[::-1])
    assert not whole.flags.writeable
    for array in (sealed, freeze_array(np.arange(6.0))[2:4], np.frombuffer(b"12345678", np.uint8)):
        assert is_frozen(array) and freeze_array(array) is array
