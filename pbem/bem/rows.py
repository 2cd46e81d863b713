"""Rows of the boundary integral equations: values at points as linear functions of nodal displacements and tractions."""

from __future__ import annotations

from dataclasses import dataclass

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
    tip (m,) int8: 1 if the displacement has the square-root shape from the start, 2 from the end, else 0.
    local (p + 1,): node coordinates in [-1, 1]. kappa: Kolosov's constant; shear_modulus: stress.
    length: unit of the logarithm in the displacement kernel. It must be several times the size of the region:
    where it equals the region's logarithmic capacity the single layer is singular.
    """

    start: Complex
    end: Complex
    tip: NDArray[np.int8]
    local: Real
    kappa: float
    shear_modulus: float
    length: float

    @property
    def count(self) -> int:
        return len(self.start)


def evaluate_rows(
    sources: Sources, point: Complex, on: Integer, normal: Complex | None = None, tractions: bool = True
) -> tuple[Real, Real | None]:
    """Matrices A, B with: value at the points = A u + B t, for nodal u, t of all elements (x, y interleaved).

    point (n,): complex. on (n,): index of the element on which a point lies (principal value, finite part), or -1.
    normal None: the value is the displacement, -int T u + int U t. normal (n,) complex: the value is the traction on
    that normal, -int S u + int D t. At a smooth boundary point the value is half the local one (free term).
    Shapes (2 n, 2 m (p + 1)); B is None without `tractions`. Tip elements carry no traction density: zero columns.
    Source: Kolosov-Muskhelishvili potentials of the single and double layer on a straight element.
    """
    shape = interpolate_shapes(sources.local)
    tip_start, tip_end = tip_shapes(tuple(sources.local))
    size = (2 * len(point), 2 * sources.count * len(sources.local))
    displacement = np.empty(size)
    traction = np.zeros(size) if tractions else None
    _kernels.rows(
        np.ascontiguousarray(point, dtype=complex),
        None if normal is None else np.ascontiguousarray(normal, dtype=complex),
        np.ascontiguousarray(on, dtype=np.int64),
        np.ascontiguousarray(sources.start, dtype=complex),
        np.ascontiguousarray(sources.end, dtype=complex),
        np.ascontiguousarray(sources.tip, dtype=np.int8),
        shape, tip_start, tip_end,
        sources.kappa, sources.shear_modulus, sources.length,
        displacement, traction,
    )  # fmt: skip
    return displacement, traction
