# SPDX-License-Identifier: Apache-2.0
"""Array types for annotations."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
"""Array of double precision numbers."""
SingleFloats = NDArray[np.float32]
"""Array of single precision numbers, for large results that need few digits."""
