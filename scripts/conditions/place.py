"""Where a model lies, how large it is and in which units: models are written about the origin, of the size 1."""

from __future__ import annotations

import cmath
import math
import random
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class Place:
    """Lengths times size, stresses times stress, turned by angle (radians) about the origin, then shifted."""

    size: float = 1.0
    stress: float = 1.0
    angle: float = 0.0
    shift: complex = 0j

    @property
    def turn(self) -> complex:
        return cmath.exp(1j * self.angle)

    def at(self, z: complex) -> list[float]:
        """A point of the model, as it is written."""
        point = self.shift + self.size * self.turn * z
        return [point.real, point.imag]

    def local(self, points: Real) -> Complex:
        """Points (n, 2) of the results, in the model's own coordinates (n,)."""
        return np.asarray((points @ [1, 1j] - self.shift) / (self.size * self.turn))

    def back(self, vectors: Real) -> Complex:
        """Vectors (..., 2) of the results, along the model's own axes."""
        return np.asarray(vectors @ np.array([1, 1j]) / self.turn)

    def pair(self, vector: complex, unit: float, first: str, second: str) -> dict[str, float]:
        """A vector times its unit, by the names of its components."""
        turned = vector * self.turn * unit
        return {first: turned.real, second: turned.imag}

    def stress_components(self, stress: tuple[float, float, float]) -> dict[str, float]:
        """s_xx, s_yy, s_xy of the model's own axes, as they are written."""
        mean = 0.5 * (stress[0] + stress[1])
        deviator = (0.5 * (stress[0] - stress[1]) + 1j * stress[2]) * self.turn**2
        return {"sxx": self.stress * (mean + deviator.real), "syy": self.stress * (mean - deviator.real),
                "sxy": self.stress * deviator.imag}  # fmt: skip

    def strain_components(self, strain: tuple[float, float, float]) -> dict[str, float]:
        """The same of a tensor of strain."""
        components = Place(angle=self.angle).stress_components(strain)
        return {"exx": components["sxx"], "eyy": components["syy"], "exy": components["sxy"]}

    def text(self, values: Real, unit: float = 1.0) -> str:
        """A polynomial sum values[j, k] x^j y^k of the model's own coordinates, as an expression of those written.

        Horner's scheme would be shorter; sums of powers stay readable and are linear where the polynomial is.
        """
        cos, sin = self.turn.real / self.size, self.turn.imag / self.size
        x0, y0 = self.shift.real, self.shift.imag
        x = f"({cos!r}*(x - ({x0!r})) + ({sin!r})*(y - ({y0!r})))"
        y = f"({cos!r}*(y - ({y0!r})) - ({sin!r})*(x - ({x0!r})))"
        terms = []
        for (j, k), value in np.ndenumerate(values):
            if value != 0.0:
                factors = [f"({unit * float(value)!r})", *[x] * j, *[y] * k]
                terms.append("*".join(factors))
        return " + ".join(terms) or "0.0"


HERE = Place()


def draw_place(seed: int) -> Place:
    """Seed 0: where the model is written; others: anywhere, turned by an odd angle, in other units."""
    if seed == 0:
        return HERE
    rng = random.Random(f"place {seed}")
    size = rng.choice((1.0, 1e-3, 25.4, 1e3, 3e5))
    shift = size * complex(rng.uniform(-1, 1), rng.uniform(-1, 1)) * rng.choice((0.0, 1.0, 1e3))
    return Place(size, rng.choice((1.0, 1e-6, 7.3, 1e6, 2e9)), math.radians(rng.uniform(-180, 180)), shift)


def is_number(value: Any) -> bool:
    return isinstance(value, int | float)
