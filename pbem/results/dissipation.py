"""What contact pairs take of the work on the boundary: stored in elastic joints, dissipated by friction and bonds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbem.contact.laws import OPEN, SLIP, PairLaws, evaluate_strength, start_memory
from pbem.mesh.mesh import Mesh
from pbem.solve.step import ContactState

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


@dataclass(frozen=True)
class PairRecord:
    """The pairs (m,) at one time: mode; traction on the first side p_n, p_s; jump g_n, g_s, and what of it the elastic
    joints do not take, rigid_n and rigid_s; fluid pressure; length of the slip so far; bonds that are lost."""

    mode: NDArray[np.int8]
    p_n: Real
    p_s: Real
    g_n: Real
    g_s: Real
    rigid_n: Real
    rigid_s: Real
    pressure: Real
    path: Real
    broken: NDArray[np.bool_]


@dataclass(frozen=True)
class PairWork:
    """In a step: work of the tractions on the jumps by the trapezoidal rule; what is stored more in the joints; what is
    dissipated (>= 0). The rest went to fluid in open pairs, or is what the rule makes of pairs that changed."""

    trapezoid: float
    stored: float
    dissipated: float


def record_pairs_at_rest(laws: PairLaws, mesh: Mesh, traction: Complex) -> PairRecord:
    """Before any load; traction (nodes,) of the in-situ stress, which the pairs bear and joints do not feel."""
    memory = start_memory(laws)
    n, borne = mesh.pairs.normal, traction[mesh.pairs.first]
    p_n, p_s = (np.conj(n) * borne).real, (np.conj(1j * n) * borne).real
    zeros = np.zeros(laws.count)
    return PairRecord(memory.modes.mode, p_n, p_s, laws.gap, zeros, laws.gap, zeros, zeros, zeros, memory.broken)


def record_pairs(laws: PairLaws, contact: ContactState, pressure: Real) -> PairRecord:
    """After a step, with its fluid pressure (m,)."""
    p_n, p_s = contact.traction_n, contact.traction_s
    return PairRecord(
        contact.mode, p_n, p_s, contact.opening, contact.slip,
        contact.opening - laws.compliance_n * p_n, contact.slip - laws.compliance_s * p_s,
        pressure, contact.slip_path, contact.broken,
    )  # fmt: skip


def measure_stored(weight: Real, record: PairRecord) -> float:
    """Energy in the elastic joints: half the traction on the joint's part of the jump."""
    normal, tangential = record.g_n - record.rigid_n, record.g_s - record.rigid_s
    return 0.5 * float(weight @ (record.p_n * normal + record.p_s * tangential))


def measure_work(laws: PairLaws, weight: Real, old: PairRecord, new: PairRecord) -> PairWork:
    """The work in a step; weight (m,): length of the boundary that belongs to each pair.

    Friction: the mean of its tractions at both ends of the step on the slip. A pair that begins to slip, or turns back,
    within the step has slipped from the friction bound that it started with on, not from the traction that it bore
    while it stuck. Bonds that part: their shear and their tension beyond the fluid pressure, falling to the new values.
    """
    trapezoid = 0.5 * ((old.p_n + new.p_n) * (new.g_n - old.g_n) + (old.p_s + new.p_s) * (new.g_s - old.g_s))
    slipped, parted = new.rigid_s - old.rigid_s, new.rigid_n - old.rigid_n
    limit = np.where(old.broken, 0.0, laws.tensile_strength) - old.pressure
    bound = evaluate_strength(laws, np.minimum(old.p_n, limit), old.path, old.pressure, old.broken).bound
    closed = old.mode != OPEN
    slides = (new.mode == SLIP) & closed & (new.broken == old.broken)
    begins = np.where(slides, np.where(slipped < 0, -bound, bound), np.where(closed, old.p_s, 0.0))
    friction = 0.5 * (begins + new.p_s) * slipped
    tension = 0.5 * (np.where(closed, old.p_n + old.pressure, 0.0) + new.p_n + new.pressure) * parted
    dissipated = np.maximum(friction, 0.0) + np.where(parted > 0, np.maximum(tension, 0.0), 0.0)
    return PairWork(
        float(weight @ trapezoid),
        measure_stored(weight, new) - measure_stored(weight, old),
        float(weight @ dissipated),
    )
