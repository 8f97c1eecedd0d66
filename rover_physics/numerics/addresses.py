"""Reading arrays inside kernels by their address.

An array is handed from kernel to kernel as nine numbers, its address as one. With two arrays and
some hundred calls a pose, handing them on took a quarter of the time.
"""

from typing import Any

import numpy as np
from numba import types
from numba.extending import intrinsic


def address_of(array: np.ndarray) -> int:
    """Return the address of an array without gaps; whoever keeps it must keep the array.

    Raises:
        ValueError: The array is not C-contiguous.
    """
    if not array.flags.c_contiguous:
        raise ValueError("an array that is read by its address must be C-contiguous")
    return array.ctypes.data


def _reader(element: types.Type, returned: types.Type) -> Any:
    """Return the code of a function (address, index) -> the element there."""

    def read(_context: Any, _address: Any, _index: Any) -> Any:
        def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
            kind = context.get_value_type(element).as_pointer()
            start = builder.inttoptr(arguments[0], kind)
            value = builder.load(builder.gep(start, [arguments[1]]))
            return context.cast(builder, value, element, returned)

        return returned(types.int64, types.int64), generate

    return read


read_float: Any = intrinsic(_reader(types.float64, types.float64))
"""Return element `index` of the float64 array at `address`."""
read_int: Any = intrinsic(_reader(types.int32, types.int64))
"""Return element `index` of the int32 array at `address`."""
