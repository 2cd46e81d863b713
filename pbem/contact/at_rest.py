"""What contact pairs bear of the in-situ stress before any load, and what it has done to their elastic joints.

In-situ stress has no displacement: joints have closed, and given way along the faces, as far as they do under it.
"""

from __future__ import annotations

import numpy as np

from pbem.arrays import Bool, Complex, Integer, Real
from pbem.mesh.mesh import Mesh
from pbem.model.in_situ import AT_REST
from pbem.model.model import Model

# Both sides of a pair bear the same traction if it differs by less than this part of the largest one.
SAME = 1e-6


def bear_in_situ(model: Model, mesh: Mesh, gone: Bool | None = None) -> tuple[Real, Real, Bool]:
    """p_n, p_s (m,) of the pairs under the in-situ stress, the mean of the sides whose region is not gone (r,), and
    whether (m,) it is the same on both sides."""
    regions = [mesh.node_region[each] for each in (mesh.pairs.first, mesh.pairs.second)]
    first, second = (_find_traction(model, mesh, each) for each in regions)
    largest = float(np.abs(np.concatenate([first, second])).max(initial=0.0))
    borne = 0.5 * (first + second)
    if gone is not None:
        borne = np.where(gone[regions[0]], second, np.where(gone[regions[1]], first, borne))
    along = np.conj(mesh.pairs.normal) * borne
    return along.real, along.imag, np.abs(first - second) <= SAME * largest


def _find_traction(model: Model, mesh: Mesh, region: Integer) -> Complex:
    """Traction (m,) across the pairs' normals of the in-situ stress in given regions (m,)."""
    pairs = mesh.pairs
    traction = np.zeros(pairs.count, dtype=complex)
    for number, each in enumerate(model.regions):
        initial, own = model.initial_stress.get(each.material.name, AT_REST), np.flatnonzero(region == number)
        if not initial.is_zero and len(own):
            sxx, syy, sxy = initial.evaluate(pairs.position[own]).T
            x, y = pairs.normal[own].real, pairs.normal[own].imag
            traction[own] = sxx * x + sxy * y + 1j * (sxy * x + syy * y)
    return traction


def close_joint(compliance: Real, stiffening: Real, borne: Real) -> tuple[Real, Real]:
    """What joints add to the opening (m,), negative under compression, and its derivative by the traction borne (m,)
    (theory, 112); stiffening: 1/length, 0 of linear joints. Under tension they are linear."""
    less = 1.0 + compliance * stiffening * np.maximum(-borne, 0.0)
    return compliance * borne / less, compliance / less**2


def settle_joints(
    model: Model, mesh: Mesh, limit: Real, compliance: tuple[Real, Real], stiffening: Real
) -> tuple[Real, Real]:
    """What joints have closed by and given way along the faces (m,), both 0 where the stress is a load: where it is not
    the same on both sides, or pulls by more than the limit (m,); compliance: normal and tangential ones."""
    p_n, p_s, balanced = bear_in_situ(model, mesh)
    bears = balanced & (p_n <= limit + SAME * float(np.hypot(p_n, p_s).max(initial=0.0)))
    closed = close_joint(compliance[0], stiffening, p_n)[0]
    return np.where(bears, closed, 0.0), np.where(bears, compliance[1] * p_s, 0.0)
