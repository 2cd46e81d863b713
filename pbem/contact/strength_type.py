"""What a friction law answers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Strength:
    """bound: largest |p_s|, stress >= 0; by_traction, by_slip: its derivatives by p_n and by the slip path."""

    bound: NDArray[np.float64]
    by_traction: NDArray[np.float64]
    by_slip: NDArray[np.float64]
