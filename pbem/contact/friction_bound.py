"""What a friction law answers."""

from __future__ import annotations

from dataclasses import dataclass

from pbem.arrays import Real


@dataclass(frozen=True)
class Strength:
    """bound: largest |p_s|, stress >= 0; by_traction, by_slip: its derivatives by p_n and by the slip path."""

    bound: Real
    by_traction: Real
    by_slip: Real
