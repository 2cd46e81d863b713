"""What cannot be counted: constants that were measured, and how often Newton's method and GMRES iterate as a rule.

Seconds are of the machine on which pbem.forecast.calibration.LOOP_SECONDS was measured; the rates of kernels,
factorisations and products are those of the machine at hand.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pbem.arrays import Real
from pbem.bem.group_sizes import MOST_CONDENSED
from pbem.bem.near import LARGE
from pbem.contact.laws import find_joint
from pbem.forecast.calibration import Speed
from pbem.forecast.disk import count_stored_steps
from pbem.forecast.work import Work
from pbem.mesh.mesh import Mesh
from pbem.model.model import Model

# Bytes of a process that has only started: Python and the libraries; and, for each unknown, what every rank keeps, with
# the dense and with the hierarchical operator, of one step and of several, between which directions are kept.
STARTED, EVERYWHERE, EVERYWHERE_FAR, EVERYWHERE_FAR_STEPS = 142e6, 2300.0, 850.0, 1280.0
# With the hierarchical operator, of which all else is small: what the first rank has beside, and for each unknown.
FIRST, FIRST_UNKNOWN, BESIDE = 17e6, 300.0, "case, file, or groups while they are formed"
# What a network's parts keep to settle by themselves (see pbem.solve.tangent.sweeps).
SETTLING = "groups of cracks that settle"
# Columns that are formed and solved for at a time (see pbem.solve.tangent), how many copies of them there are where no
# pair changes, and where some do; and how their number grows with that of the ranks.
AT_ONCE, COPIES_FORMED, COPIES_SOLVED, SHARED = 512, 1.5, 4.0, 0.4
# Of the hierarchical operator near blocks, those of large models (see pbem.bem.near), and groups' inverses, to what is
# counted; of MUMPS' factors likewise.
NEAR_MEMORY, PACKED_MEMORY, INVERSES, SPARSE_FACTORS, SPARSE_FACTORS_SHARED = 1.0, 0.64, 0.4, 1.0, 1.6
# Of all bodies' tangent operator, in PETSc's and MUMPS' copies, and of its factors beyond those.
BODIES_FORMED, BODIES_FACTORS = 4.0, 1.3
# Of several ranks' dense factors for GMRES, which ScaLAPACK does not put in the place of the matrix.
SCATTERED = 1.2

# Newton iterations of the first step where pairs change their status: to slip; open too; or nobody knows; of a further
# step of the first stage, in which loads grow in proportion, where that is all known; of a step of a further stage.
SLIPPING, OPENING, UNKNOWN, ALIKE, FURTHER = 4.0, 7.0, 4.0, 0.25, 2.0
# Where faces soften the tangent operator changes with each iteration: Newton iterations and factorisations of a step.
SOFTENING, SOFTENING_FACTORS = 3.0, 2.0
# Factorisations where they may be made anew, and where nobody knows; iterations of GMRES in a system, and where nothing
# changes; products beside those.
FACTORISATIONS, FACTORISATIONS_UNKNOWN, GMRES, GMRES_SETTLED, PRODUCTS = 2.0, 1.4, 8.0, 3.0, 3.0
# Part of the changeable pairs whose columns are asked for at most, where they are not all computed at once.
CHANGING = 0.35

# Seconds: of the start; of a vector's entry in an iteration, and with the hierarchical operator; of an entry in a
# product, shared and on every rank; of an unknown in the preconditioner; of a call of a library that shares matrices;
# of an interior point and a node.
START, VECTOR, VECTOR_FAR, PRODUCT, PRODUCT_ALONE = 1.05, 10e-6, 5e-6, 0.36e-6, 0.03e-6
INVERSE, CALL, POINT = 5e-6, 0.1, 0.15e-6
# Of an unknown in the assembly of the hierarchical operator; of a crack in the tables and checks of the file, in the
# estimate of errors, and there in each step.
PLACED, CRACK_WRITTEN, CRACK_JUDGED, CRACK_JUDGED_STEP = 20e-6, 2e-3, 2.6e-3, 0.9e-3
# To the calibrated rates of kernels (dense, near blocks), bytes that are moved, and operations.
ENTRY, NEAR, FORMED, FACTOR, FACTOR_SHARED, COLUMN = 0.65, 1.0, 110.0, 0.5, 1.0, 0.5
SPARSE, SPARSE_SHARED, GROUPED = 1.1, 2.4, 0.65
# How the rate of shared dense factors, on more ranks than two, grows with their number.
FACTOR_RANKS = 1.0


@dataclass(frozen=True)
class Size:
    """Of a model: its curves, cracks, regions, nodes, load steps, those that are stored, stages, and interior points.
    """

    curves: int
    cracks: int
    regions: int
    nodes: int
    steps: int
    stored: int
    stages: int
    points: int


def measure_size(model: Model, nodes: int) -> Size:
    """The numbers that follow from the model, and its nodes."""
    steps = sum(stage.steps for stage in model.stages)
    return Size(len(model.curves), len(model.crack_tips), len(model.regions), nodes, steps, count_stored_steps(model),
                len(model.stages), len(model.interior_points))


@dataclass(frozen=True)
class Changes:
    """Newton iterations of all steps, the part of the changeable pairs whose status is going to change, and how often
    the tangent operator is factorised, where its factors may be made anew; as a rule."""

    iterations: float
    part: float
    factorisations: float = 1.0


def expect_changes(model: Model, mesh: Mesh, pairs: int) -> Changes:
    """What the stress far away asks of each pair, as if it were alone; without such a stress what is usual.

    pairs: that can change their status.
    """
    first, further = model.stages[0], sum(stage.steps for stage in model.stages[1:])
    remote = np.array([stage.remote for stage in model.stages])
    number, part, factors = UNKNOWN, 1.0, FACTORISATIONS_UNKNOWN
    if remote.any() and not model.conditions and pairs:
        part, opened = _judge_pairs(model, mesh, remote[np.abs(remote).sum(axis=1).argmax()])
        number, factors = OPENING if opened else SLIPPING if part else 1.0, FACTORISATIONS
    if pairs and _has_softening(model, mesh):
        steps = first.steps + further
        return Changes(SOFTENING * steps, part, SOFTENING_FACTORS * steps)
    if not pairs or not part:
        return Changes(float(first.steps + further), 0.0)
    return Changes(number + ALIKE * (first.steps - 1) + FURTHER * further, part, factors)


def expect_second_changes(model: Model, mesh: Mesh, steps: int) -> Changes:
    """Of the second solution, which begins from the statuses of the first; some of its steps make factors anew."""
    if _has_softening(model, mesh):
        return Changes(SOFTENING * steps, 0.0, SOFTENING_FACTORS * steps)
    return Changes(float(steps), 0.0, 0.75 + 0.25 * steps)


def _has_softening(model: Model, mesh: Mesh) -> bool:
    """Whether some faces bear less the more they part."""
    return any(find_joint(model, name).law.softening is not None for name in mesh.interface_names)


def _judge_pairs(model: Model, mesh: Mesh, stress: Real) -> tuple[float, bool]:
    """The part of all pairs that slip or open, but began otherwise, and whether some open. stress: sxx, syy, sxy."""
    laws = [find_joint(model, name).law for name in mesh.interface_names]
    of = mesh.pairs.interface
    friction, bound, tension = (
        np.array([getattr(law, name) for law in laws])[of] for name in ("friction", "cohesion", "tensile_strength")
    )
    fixed = np.array([law.kind in ("bonded", "open") for law in laws])[of]
    n = mesh.pairs.normal
    pull = (stress[0] * n.real + stress[2] * n.imag) + 1j * (stress[2] * n.real + stress[1] * n.imag)
    t_n, t_s = (pull * n.conj()).real, np.abs((pull * n.conj()).imag)
    opens = ~fixed & (t_n > tension)
    slips = ~fixed & ~opens & (t_s > bound - friction * t_n) & ((friction > 0) | (bound > 0))
    return float((opens | slips).sum()) / max(int((~fixed).sum()), 1), bool(opens.any())


def list_memory(work: Work, ranks: int, part: float, steps: int) -> dict[str, float]:
    """Bytes over all ranks by use, without the processes themselves; part: of the pairs, see Changes. steps: of load.

    BESIDE is what the first rank has, or the ranks that form groups, but not at once; see `measure_beside`.
    """
    sparse = SPARSE_FACTORS if ranks == 1 else SPARSE_FACTORS_SHARED
    if work.hierarchical and work.sparse:
        inverses = work.besides + BODIES_FORMED * work.formed + BODIES_FACTORS * sparse * work.factored
    else:
        inverses = INVERSES * work.factored
    if work.hierarchical:
        near = PACKED_MEMORY if work.unknowns >= LARGE else NEAR_MEMORY
        everywhere = EVERYWHERE_FAR if steps == 1 else EVERYWHERE_FAR_STEPS
        at_once = max(min(ranks, work.groups.count) * 8 * work.groups.largest, ranks * _measure_cluster(work))
        settling = {SETTLING: 4 * work.settling} if work.settling else {}
        return {"operator": 8 * near * work.entries, "preconditioner": 8 * (inverses + work.groups.kept), **settling,
                "mesh and vectors": everywhere * ranks * work.unknowns,
                BESIDE: max(FIRST + FIRST_UNKNOWN * work.unknowns, at_once)}
    changing = 0.0 if work.columns else 2.0 * min(part, CHANGING) * work.pairs
    factors = (sparse if work.sparse else SCATTERED if work.scattered and ranks > 1 else 0.0) * work.factored
    copies = COPIES_SOLVED if part or work.columns else COPIES_FORMED
    return {
        "operator": 8 * (work.entries + work.besides),
        "tangent operator": 8 * (work.formed + factors),
        "columns of pairs": 8 * work.unknowns * (work.columns + changing),
        "columns at a time": 8 * min(AT_ONCE, work.unknowns / 2) * copies * work.unknowns * ranks**SHARED,
        "mesh and vectors": EVERYWHERE * ranks * work.unknowns,
    }  # fmt: skip


def measure_beside(work: Work) -> float:
    """Bytes that one rank has at most of what `list_memory` calls BESIDE; none with the dense operator."""
    if not work.hierarchical:
        return 0.0
    return max(FIRST + FIRST_UNKNOWN * work.unknowns, 8 * work.groups.largest, _measure_cluster(work))


def _measure_cluster(work: Work) -> float:
    """Bytes of the matrix of a cluster that settles by itself, with what follows it."""
    return 8.0 * min(work.unknowns, MOST_CONDENSED) ** 2 if work.settling else 0.0


def list_seconds(work: Work, size: Size, ranks: int, speed: Speed, changes: Changes) -> dict[str, float]:
    """Seconds of one problem by piece."""
    python, share = speed.python, 1.0 / ranks
    iterations = changes.iterations
    vectors = python * VECTOR * iterations * work.unknowns
    if work.hierarchical:
        vectors = python * VECTOR_FAR * iterations * work.unknowns
        products = iterations * ((1.0 if work.sparse else GMRES if changes.part else GMRES_SETTLED) + PRODUCTS)
        groups = GROUPED * (ENTRY * speed.entry * work.groups.entries + speed.operation * work.groups.operations)
        inverses = python * work.unknowns * INVERSE * share + groups / max(1, min(ranks, work.groups.count))
        if work.sparse:
            inverses = speed.operation * SPARSE * share * work.operations + CALL * python
        return {
            "assembly": (NEAR * speed.entry * work.entries + PLACED * python * work.unknowns) * share,
            "steps": vectors + python * work.unknowns * (
                products * (PRODUCT * share + PRODUCT_ALONE)) + iterations * inverses,
        }  # fmt: skip
    factors = changes.factorisations if changes.part == 0.0 or not work.columns else 1.0
    columns = work.columns or 2.0 * min(changes.part, CHANGING) * work.pairs
    alone, shared = (SPARSE, SPARSE_SHARED) if work.sparse else (FACTOR, FACTOR_SHARED)
    crowd = (max(ranks, 2) / 2) ** (0.0 if work.sparse else FACTOR_RANKS)
    rate = speed.operation * (alone if ranks == 1 else shared * crowd) * share
    return {
        "assembly": ENTRY * speed.entry * (work.entries + work.besides) * share,
        "steps": vectors + factors * (FORMED * speed.byte * 8 * work.formed * share + rate * work.operations
                                      + (CALL * python if ranks > 1 or work.sparse else 0.0))
        + COLUMN * speed.operation * 2 * work.factored * columns * share,
    }  # fmt: skip


def list_overhead(size: Size, speed: Speed) -> dict[str, float]:
    """Seconds of what is done beside the solutions, by the first rank or by all alike."""
    python = speed.python
    return {
        "start": python * START,
        "reading": python * (0.5e-3 * size.curves + 15e-3 * (size.regions - 1) + 25e-6 * size.nodes),
        "evaluation": python * size.stored * size.points * POINT * size.nodes,
        "writing": python * (0.05 + 0.016 * size.stored + CRACK_WRITTEN * size.cracks
                             + (20e-6 + 8e-6 * size.stored) * size.nodes),
        "estimate": python * (CRACK_JUDGED + CRACK_JUDGED_STEP * size.steps) * size.cracks,
    }
