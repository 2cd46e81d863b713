"""In-situ stress, uniform or linear in the coordinates, as at rest under its own weight."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from pbem.arrays import Complex, Real
from pbem.description.field_tables import InSituTable
from pbem.errors import Fault, KeyPath
from pbem.geometry.expression import ExpressionError
from pbem.geometry.junction import format_point
from pbem.model.linear import fit_linear

Stress = tuple[float, float, float]
NONE: Stress = (0.0, 0.0, 0.0)
COMPONENTS = ("sxx", "syy", "sxy")
# A weight is balanced to this part of it; numbers in a file are rounded.
BALANCED = 1e-6


@dataclass(frozen=True)
class LinearStress:
    """sxx, syy, sxy: their values at `center`, and what they grow by with x and with y."""

    value: Stress = NONE
    by_x: Stress = NONE
    by_y: Stress = NONE
    center: complex = 0j

    @property
    def is_uniform(self) -> bool:
        return not (any(self.by_x) or any(self.by_y))

    @property
    def is_zero(self) -> bool:
        return self.is_uniform and not any(self.value)

    @property
    def divergence(self) -> complex:
        """Its divergence (complex): minus the body force that it balances."""
        return complex(self.by_x[0] + self.by_y[2], self.by_x[2] + self.by_y[1])

    @property
    def steepest(self) -> float:
        """The largest magnitude among the slopes that its divergence adds up: they may balance each other, without
        any weight, and then leave their rounding."""
        return max(map(abs, (self.by_x[0], self.by_y[2], self.by_x[2], self.by_y[1])))

    def evaluate(self, point: Complex) -> Real:
        """The components (n, 3) at points (n,)."""
        away = point - self.center
        stress: Real = np.outer(away.real, self.by_x) + np.outer(away.imag, self.by_y) + np.array(self.value)
        return stress

    def describe(self, origin: complex) -> tuple[str, ...]:
        """The components in words; origin: of the model, in the user's coordinates."""
        if self.is_uniform:
            return tuple(f"{value:g}" for value in self.value)
        at = format_point(self.center + origin)
        return tuple(
            f"{value:g}" + "".join(f" {slope:+g} per {axis}" for slope, axis in ((x, "x"), (y, "y")) if slope)
            + (f" from {at}" if x or y else "")
            for value, x, y in zip(self.value, self.by_x, self.by_y, strict=True)
        )

    def mix(self, other: LinearStress, part: float) -> LinearStress:
        """So much of the way to another one about the same center; one that is zero may have any."""
        value, by_x, by_y = (
            tuple(a + part * (b - a) for a, b in zip(one, two, strict=True))
            for one, two in ((self.value, other.value), (self.by_x, other.by_x), (self.by_y, other.by_y))
        )
        return LinearStress(value, by_x, by_y, other.center if self.is_zero else self.center)  # type: ignore[arg-type]

    def move(self, shift: complex) -> LinearStress:
        """The same about another origin: the places of the model have become less by the shift."""
        return self if self.is_uniform else replace(self, center=self.center - shift)


AT_REST = LinearStress()


def read_in_situ(loc: KeyPath, table: InSituTable, corners: Complex) -> tuple[LinearStress, list[Fault]]:
    """The stress that a table gives, with faults for what is not linear.

    corners (3,): lower left and right, and upper left, of a rectangle in which the case lies.
    """
    faults: list[Fault] = []
    columns = []
    for key in COMPONENTS:
        given = getattr(table, key)
        if isinstance(given, float):
            columns.append((given, 0.0, 0.0))
            continue
        try:
            columns.append(fit_linear(given.expression, corners))
        except ExpressionError as error:
            faults.append(Fault.at((*loc, key), error.found, error.expected))
    if faults:
        return AT_REST, faults
    value, by_x, by_y = zip(*columns, strict=True)
    linear = any(by_x) or any(by_y)
    return LinearStress(value, by_x, by_y, complex(corners[0]) if linear else 0j), []


def check_rest(loc: KeyPath, stress: LinearStress, density: float, gravity: complex) -> Iterator[Fault]:
    """A fault if the stress of a material is not in balance with the weight that it carries at rest."""
    left = stress.divergence + density * gravity
    scale = max(stress.steepest, abs(density * gravity))
    if not stress.is_uniform and abs(left) > BALANCED * scale:
        found = (f"a stress that grows by ({stress.divergence.real:.6g}, {stress.divergence.imag:.6g}) per length "
                 f"against a weight of ({density * gravity.real:.6g}, {density * gravity.imag:.6g}) per volume")
        expected = ("in balance with the weight at rest: d sxx/dx + d sxy/dy = -density gx, "
                    "d sxy/dx + d syy/dy = -density gy, with the gravity of [gravity]")
        yield Fault.at(loc, found, expected)
