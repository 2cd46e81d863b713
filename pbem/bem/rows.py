"""Rows of the integral equations: values at points as linear functions of nodal displacements and tractions."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pbem.arrays import Complex, Integer, Real
from pbem.bem import _kernels
from pbem.geometry.elements import Elements
from pbem.mesh.shape_functions import interpolate_shapes, tip_shapes


@dataclass(frozen=True)
class Sources:
    """The elements of one region, as the kernels see them.

    start, end (m,): complex, region on the left; a crack element's displacement is the jump first minus second face.
    center, sweep (m,): centre and signed angle (radians) of an arc; 0 for a straight element.
    family (m,) int8: 0 on boundaries, 3 on cracks, 1 and 2 on cracks with a tip's square-root shape from start or end.
    local, crack_local (p + 1,): node coordinates in [-1, 1] on boundaries and on cracks (default: the same).
    kappa: Kolosov's constant; shear_modulus: stress.
    length: unit of the logarithm in the displacement kernel. It must be several times the size of the region:
    where it equals the region's logarithmic capacity the single layer is singular.
    """

    start: Complex
    end: Complex
    family: NDArray[np.int8]
    local: Real
    kappa: float
    shear_modulus: float
    length: float
    center: Complex | None = None
    sweep: Real | None = None
    crack_local: Real | None = None

    @property
    def count(self) -> int:
        return len(self.start)

    @cached_property
    def shape(self) -> Real:
        """Coefficients (4, p + 1, p + 1) of the shapes: family by power by node."""
        on_crack = self.local if self.crack_local is None else self.crack_local
        tips = tip_shapes(tuple(on_crack))
        return np.stack([interpolate_shapes(self.local), *tips, interpolate_shapes(on_crack)])

    @cached_property
    def geometry(self) -> Elements:
        """The elements by themselves, none of their numbers missing."""
        return Elements.complete(self.start, self.end, self.center, self.sweep)

    @cached_property
    def elements(self) -> tuple[Complex, Complex, Complex, Real, NDArray[np.int8], Real]:
        """start, end, center, sweep, family, local as the kernels read them: contiguous, none missing."""
        return (
            np.ascontiguousarray(self.start, dtype=complex),
            np.ascontiguousarray(self.end, dtype=complex),
            np.ascontiguousarray(self.geometry.center, dtype=complex),
            np.ascontiguousarray(self.geometry.sweep, dtype=float),
            np.ascontiguousarray(self.family, dtype=np.int8),
            np.ascontiguousarray(self.local, dtype=float),
        )

    def select(self, indices: Integer) -> Sources:
        """Some of the elements, in the given order, e.g. a block of a hierarchical operator; in microseconds."""
        chosen = self.geometry.select(indices)
        selected = replace(
            self, start=chosen.start, end=chosen.end, center=chosen.center, sweep=chosen.sweep,
            family=self.family[indices],
        )
        vars(selected)["shape"] = self.shape  # the same nodes
        return selected

    def cut(self, begin: int, end: int) -> Sources:
        """The elements begin .. end - 1, which are not copied."""
        start, finish, center, sweep, family, local = self.elements
        some = slice(begin, end)
        cut = Sources(
            start[some], finish[some], family[some], self.local, self.kappa, self.shear_modulus, self.length,
            center[some], sweep[some], self.crack_local,
        )
        vars(cut)["shape"] = self.shape
        vars(cut)["elements"] = (cut.start, cut.end, cut.center, cut.sweep, cut.family, local)
        return cut


def evaluate_rows(
    sources: Sources,
    point: Complex,
    on: Integer,
    normal: Complex | None = None,
    tractions: bool = True,
    on_local: Real | None = None,
    out: tuple[Real, Real] | None = None,
) -> tuple[Real, Real | None]:
    """Matrices A, B with: value at the points = A u + B t, for nodal u, t of all elements (x, y interleaved).

    point (n,): complex. on (n,): index of the element on which a point lies (principal value, finite part), or -1.
    normal None: the value is the displacement, -int T u + int U t. normal (n,) complex: the value is the traction on
    that normal, -int S u + int D t. At a smooth boundary point the value is half the local one (free term).
    on_local (n,): the points' coordinates on those elements, needed on arcs. out: arrays of the results' width with at
    least 2 n rows to put them in, the second full of zeros at first; fresh pages cost more time than the kernels.
    Shapes (2 n, 2 m (p + 1)); B is None without `tractions`. Tip elements carry no traction density: zero columns.
    On an arc the densities are polynomials of s with a point at apex (1 + i q s)/(1 - i q s) from the centre,
    q = tan(sweep/4); tractions are such polynomials times 1 + q^2 s^2.
    Source: Kolosov-Muskhelishvili potentials of the single and double layer; Cauchy integrals in closed form.
    (theory, 7, 8)
    """
    size = (2 * len(point), 2 * sources.count * len(sources.local))
    displacement, traction = (np.empty(size), np.zeros(size) if tractions else None) if out is None else (
        out[0][: size[0]], out[1][: size[0]] if tractions else None
    )  # fmt: skip
    local = np.zeros(len(point)) if on_local is None else on_local
    _kernels.rows(
        np.ascontiguousarray(point, dtype=complex),
        np.ascontiguousarray(on, dtype=np.int64),
        np.ascontiguousarray(local, dtype=float),
        *sources.elements,
        sources.shape,
        sources.kappa, sources.shear_modulus, sources.length,
        displacement,
        None if normal is None else np.ascontiguousarray(normal, dtype=complex),
        traction,
    )  # fmt: skip
    return displacement, traction
