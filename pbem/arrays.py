"""Types of the arrays that go between modules, by what they hold. Shapes are in the docstrings of their users."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]
Single = NDArray[np.float32]
Complex = NDArray[np.complex128]
Integer = NDArray[np.int64]
Bool = NDArray[np.bool_]
