"""What differences of a run from its second solution are divided by, of each kind of value (theory, 77 and 126)."""

from __future__ import annotations

import numpy as np

from pbem.arrays import Real
from pbem.model.model import Model
from pbem.results.rates import (
    KINK,
    Ends,
    choose_force_divisor,
    choose_jump_divisors,
    find_rise,
    find_weak_ends,
    list_corner_elements,
    list_factor_shares,
    list_force_shares,
)
from pbem.solve.estimate.coarser_mesh import Beside

# The error of the second solution over that of the run, less one, by order: 2^rate - 1 for the rate order + 1, at most
# 5; with the order lowered by one. Measured over the problems with known answers by scripts/bench_estimate.py.
MERGED = (1.0, 3.0, 5.0, 5.0)
LOWERED = 5.0


class Divisors:
    """Of one pair of meshes.

    weak (c,): pairs of the second solution whose differences are divided by next to nothing.
    """

    def __init__(self, model: Model, beside: Beside, as_they_are: bool = False) -> None:
        """model: of the run; as_they_are: nothing is divided."""
        self._slave = slave = beside.mesh.pairs.slave // (beside.mesh.order + 1)
        self._weight = beside.mesh.pairs.weight
        self._whole = as_they_are
        self._corners = list_corner_elements(model, beside)
        self._modulus = np.array([region.material.plane_modulus for region in model.regions])[beside.fine.region]
        if as_they_are:
            self.weak = np.zeros(len(slave), dtype=bool)
            return
        self._smooth = smooth = MERGED[model.analysis.order] if beside.kind == "merged" else LOWERED
        self._at_end = find_rise(beside, 2.0, KINK) - 1
        by_element = choose_jump_divisors(model, beside, smooth)
        self._nodes, self._pairs = np.repeat(by_element, beside.mesh.order + 1), by_element[slave]
        self.weak = find_weak_ends(model, beside)[slave]
        self._force_shares = list_force_shares(model, beside, smooth)
        self._factor_shares = list_factor_shares(model, beside, smooth)

    def of_forces(self, energy: Real) -> float:
        """energy (2, e): of the difference, on the elements of the run."""
        return 1.0 if self._whole else choose_force_divisor(self._square(energy), self._force_shares, self._smooth)

    def of_factors(self, energy: Real) -> float:
        """Of factors, and of jumps away from corners."""
        return 1.0 if self._whole else choose_force_divisor(self._square(energy), self._factor_shares, self._smooth)

    def of_displacements(self, energy: Real) -> Real:
        """At the nodes of the second solution: what is wrong at corners moves all of a body."""
        return np.ones(1) if self._whole else np.minimum(self._nodes, self.of_forces(energy))

    def of_jumps(self, ends: Ends, energy: Real) -> Real:
        """At the pairs of the second solution (theory, 77)."""
        if self._whole:
            return np.ones(len(self.weak))
        return ends.choose_jump_divisors(np.minimum(self._pairs, self.of_factors(energy)), self._at_end)

    def of_tractions(self, ends: Ends, differences: Real) -> Real:
        """At the pairs of the second solution; differences (2, c): of normal and shear tractions."""
        if self._whole:
            return np.ones(len(self.weak))
        square, number = self._weight * (differences**2).sum(axis=0), self._nodes.size
        length = np.bincount(self._slave, self._weight, number)
        size = np.bincount(self._slave, square, number) / np.where(length > 0, length, 1.0)
        corners = self._corners.choose_divisors(self._smooth, size)[self._slave]
        return np.minimum(ends.choose_divisors(self._smooth), corners)

    def look_beyond(self, values: Real) -> Real:
        """Values (e,) of the second solution's elements, in corners those of the next one away from it, or zero."""
        result, corners = values.copy(), self._corners
        result[corners.element] = np.where(corners.beyond < 0, 0.0, values[corners.beyond])
        return result

    def _square(self, energy: Real) -> Real:
        # A stiff region goes along with a soft one: the energy of that is none of its own.
        return np.asarray(energy.sum(axis=0) / self._modulus)
