"""Rows of the integral equations: values at points as linear functions of nodal displacements and tractions."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pbem.bem import _kernels
from pbem.mesh.shapes import interpolate_shapes, tip_shapes

Complex = NDArray[np.complex128]
Integer = NDArray[np.int64]
Real = NDArray[np.float64]


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

    def select(self, numbers: Integer) -> Sources:
        """The elements of the given numbers (k,), in that order."""
        return replace(
            self, start=self.start[numbers], end=self.end[numbers], family=self.family[numbers],
            center=None if self.center is None else self.center[numbers],
            sweep=None if self.sweep is None else self.sweep[numbers],
        )  # fmt: skip


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
    """
    on_crack = sources.local if sources.crack_local is None else sources.crack_local
    shape = np.stack([interpolate_shapes(sources.local), *tip_shapes(tuple(on_crack)), interpolate_shapes(on_crack)])
    size = (2 * len(point), 2 * sources.count * len(sources.local))
    displacement, traction = (np.empty(size), np.zeros(size) if tractions else None) if out is None else (
        out[0][: size[0]], out[1][: size[0]] if tractions else None
    )  # fmt: skip
    center = np.zeros(sources.count, dtype=complex) if sources.center is None else sources.center
    sweep = np.zeros(sources.count) if sources.sweep is None else sources.sweep
    local = np.zeros(len(point)) if on_local is None else on_local
    _kernels.rows(
        np.ascontiguousarray(point, dtype=complex),
        np.ascontiguousarray(on, dtype=np.int64),
        np.ascontiguousarray(local, dtype=float),
        np.ascontiguousarray(sources.start, dtype=complex),
        np.ascontiguousarray(sources.end, dtype=complex),
        np.ascontiguousarray(center, dtype=complex),
        np.ascontiguousarray(sweep, dtype=float),
        np.ascontiguousarray(sources.family, dtype=np.int8),
        np.ascontiguousarray(sources.local),
        shape,
        sources.kappa, sources.shear_modulus, sources.length,
        displacement,
        None if normal is None else np.ascontiguousarray(normal, dtype=complex),
        traction,
    )  # fmt: skip
    return displacement, traction
