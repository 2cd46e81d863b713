"""The largest part of a load step that forces in the contacts could balance, whatever the bodies' elasticity.

Static admissibility (the lower bound of limit analysis, here as a necessary condition): tractions of the pairs within
their laws, and of what is held, have to balance the loads on every finite body. Beyond the fraction at which none do
no smaller step finds an equilibrium. A linear programme in the tractions of the nodes and the fraction.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from pbem.arrays import Integer, Real
from pbem.contact.laws import Memory, PairLaws, tensile_limit
from pbem.contact.loads import Load
from pbem.linear_programme import INFEASIBLE, SOLVED, minimise
from pbem.solve.problem.given import BALANCED, collect_given, find_push
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.step import Former

# A share that is less than the whole by no more than this is the whole.
ROUNDING = 1e-6
# Models with more pairs are not asked.
MOST_PAIRS = 20_000


def find_balanced_fraction(problem: Problem, memory: Memory, stage: int, reached: float, target: float) -> float | None:
    """The largest fraction of a stage in [reached, target] whose loads some tractions balance; None if unknown.

    reached itself where hardly more than its loads are balanced, target where all are. Of the pairs those between
    bodies count, without what they have lost for good, but as if none of them had slipped; what the faces of a crack
    carry acts within one body and balances by itself. Unknown for laws that do not say how much they bear, models
    without finite bodies, and where the programme finds no balance at `reached` itself.
    """
    solved = _solve(problem, memory, stage, reached, target)
    share = solved.share if solved else None
    if share is None or share > 1 - ROUNDING:
        return None if share is None else target
    return reached + share * (target - reached)


def can_balance(problem: Problem, memory: Memory, stage: int, fraction: float) -> bool | None:
    """Whether some tractions balance the loads at a fraction of a stage; None if unknown, as above."""
    solved = _solve(problem, memory, stage, fraction, fraction)
    return None if solved is None or not solved.certain else solved.share is not None


@dataclass(frozen=True)
class Held:
    """What friction and cohesion hold of each pair, stresses >= 0 (m,): at the fraction that was reached, and at the
    target less that."""

    bound: Real
    rise: Real


def find_held(
    problem: Problem, memory: Memory, former: Former | None, stage: int, reached: float, target: float
) -> Held | None:
    """With the normal tractions that were reached, which go on as from the step before it; None if not known, and where
    faces part as they slip, which presses them together."""
    if any(group.law.dilates for group in problem.laws.strengths):
        return None
    loads = [problem.evaluate_load(stage, factor).pressure for factor in (reached, target)]
    if any(load.any() for load in loads) or any(
        group.law.find_strongest(group.parameters) is None for group in problem.laws.strengths
    ):
        return None
    friction, cohesion = _find_strongest(problem.laws, memory)
    bound = cohesion + friction * np.maximum(-memory.normal_traction, 0.0)
    rise = np.zeros_like(bound)
    if former is not None and former.fraction < reached:
        ahead = (target - reached) / (reached - former.fraction)
        rise = friction * (former.normal_traction - memory.normal_traction) * ahead
    return Held(bound, np.maximum(rise, -bound))


def find_sliding_fraction(
    problem: Problem, memory: Memory, former: Former | None, stage: int, reached: float, target: float
) -> float | None:
    """The fraction of a stage beyond which bodies slide if the pressures in the contacts stay what they are, or go on
    as from the step before (`former`): forces across the faces may be any there (theory, 57, with their friction as a
    cohesion). None if none of [reached, target] is such, or if it is not known.

    Pressures are given, as slip under Coulomb's law does not open faces: a bound that leaves them free would let a
    ring press itself onto its shaft.
    """
    held = find_held(problem, memory, former, stage, reached, target)
    if held is None or not held.bound.any():
        return None
    solved = _solve(problem, memory, stage, reached, target, held)
    share = solved.share if solved else None
    return None if share is None or share > 1 - ROUNDING else reached + share * (target - reached)


@dataclass(frozen=True)
class _Solved:
    """The largest share of a change of loads that is balanced, None if no share is; certain: whether that is so."""

    share: float | None
    certain: bool


def _solve(
    problem: Problem, memory: Memory, stage: int, reached: float, target: float, held: Held | None = None
) -> _Solved | None:
    """For the change from one fraction of a stage to another one; None where the programme cannot be posed. held: what
    bounds the shear tractions in place of friction."""
    mesh, laws = problem.mesh, problem.laws
    finite = np.array([not region.infinite for region in problem.model.regions])
    if laws.count > MOST_PAIRS or not finite.any() or not (~mesh.pairs.crack).any():
        return None
    if any(group.law.find_strongest(group.parameters) is None for group in laws.strengths):
        return None
    if problem.model.timed and target > reached:
        return None  # loads are not linear in between
    if problem.arrangement is not None:
        return None  # faces bear what no law gives them
    loads = [problem.evaluate_load(stage, factor) for factor in (reached, target)]
    matrix, before, after = _sum_up(problem, loads, np.flatnonzero(finite))
    size = max(np.abs(before).max(), np.abs(after).max())
    if not size > 0:
        return _Solved(1.0, True)
    return _maximise(problem, memory, loads, matrix, before / size, (after - before) / size, size, held)


def _sum_up(
    problem: Problem, loads: list[Load], regions: Integer
) -> tuple[sparse.csr_matrix, Real, Real]:
    """Force and moment over length of every region (3 k,): what unknown tractions add (3 k, 2 nodes), and loads.

    Of rigid tools those that are given; what holds a given motion bears anything.
    """
    mesh = problem.mesh
    maps, known = zip(*(collect_given(problem, load) for load in loads), strict=True)
    weight = np.where(mesh.node_crack, 0.0, mesh.weight)
    rows, columns, values = [], [], []
    pushes, balances = np.zeros((2, 3 * len(regions))), np.ones(3 * len(regions), dtype=bool)
    for row, region in enumerate(regions):
        own = np.flatnonzero(mesh.node_region == region)
        support = problem.model.regions[region].material.rigid
        lever = mesh.position[own] - (mesh.position[own].mean() if support is None else support.about)
        reach = np.abs(lever).max()
        lever = lever / reach
        if support is not None:
            balances[3 * row : 3 * row + 3] = support.forced
            pushes[:, 3 * row : 3 * row + 3] = [find_push(problem, region, load) / [1, 1, reach] for load in loads]
        for part, along in enumerate((np.ones_like(lever), np.full_like(lever, 1j), 1j * lever)):
            for component, value in enumerate((along.real, along.imag)):
                rows.append(np.full(len(own), 3 * row + part))
                columns.append(2 * own + component)
                values.append(weight[own] * value)
    entries = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
    resultant = sparse.csr_matrix(entries, shape=(3 * len(regions), 2 * mesh.nodes))
    before, after = (resultant @ each + push for each, push in zip(known, pushes, strict=True))
    matrix = resultant @ maps[0].matrix[2 * mesh.nodes :]
    return matrix[balances], before[balances], after[balances]


def _maximise(
    problem: Problem, memory: Memory, loads: list[Load], matrix: sparse.csr_matrix, constant: Real, change: Real,
    size: float, held: Held | None,
) -> _Solved:
    """The largest share of the change that is balanced (theory, 57).

    Unknowns: tractions times the model's length over `size`, in the order of the map's unknowns, and the share.
    """
    mesh, laws = problem.mesh, problem.laws
    scale = size / problem.model.size
    columns = 2 * mesh.nodes
    at_n, at_s = 2 * mesh.pairs.slave, 2 * mesh.pairs.slave + 1
    pressure, rise = loads[0].pressure / scale, (loads[1].pressure - loads[0].pressure) / scale
    friction, cohesion = _find_strongest(laws, memory)
    limit = tensile_limit(laws, memory)
    low, high = np.full(columns + 1, -np.inf), np.full(columns + 1, np.inf)
    low[-1], high[-1] = 0.0, 1.0
    balance = sparse.hstack([matrix * (1 / problem.model.size), change[:, None]]).tocsr()
    used = np.zeros(columns + 1, dtype=bool)
    used[np.unique(balance.indices)] = used[-1] = True
    # What the faces of a crack carry balances by itself, within the one body: their laws would bound nothing but the
    # share, by their pressure.
    bearing = used[at_n] | used[at_s]
    used[at_n[bearing]] = used[at_s[bearing]] = True
    # Without pressure parted faces carry nothing; with it, what it gives.
    own = bearing & ~(laws.bonded | laws.follows | laws.parted)
    parted = np.flatnonzero(bearing & laws.parted)
    count, last = len(own), np.full(len(own), columns)
    pair = np.arange(count)

    def build(blocks: list[tuple[Real, Integer]]) -> sparse.csr_matrix:
        parts = [sparse.csr_matrix((value, (pair, column)), shape=(count, columns + 1)) for value, column in blocks]
        return sum(parts[1:], parts[0])

    inside = np.where(laws.fluid_inside, friction, 0.0)
    one = np.ones(count)
    bounds = [
        (build([(one, at_n), (rise, last)]), limit / scale - pressure),
        (build([(one, at_s), (friction, at_n), (inside * rise, last)]), cohesion / scale - inside * pressure),
        (build([(-one, at_s), (friction, at_n), (inside * rise, last)]), cohesion / scale - inside * pressure),
    ]
    if held is not None:
        bounds = [(build([(sign * one, at_s), (-held.rise / scale, last)]), held.bound / scale) for sign in (1, -1)]
    above = sparse.vstack([rows[own] for rows, _ in bounds])
    most = np.concatenate([values[own] for _, values in bounds])
    low[at_s[parted]] = high[at_s[parted]] = 0.0
    fixed = build([(one, at_n), (rise, last)])[parted]
    # What is left may grow with the loads.
    spare = BALANCED * np.abs(constant).max()
    left = BALANCED * sparse.csr_matrix(([np.abs(change).max()] * len(change), (np.arange(len(change)), [columns] *
                                        len(change))), shape=balance.shape)
    cost = np.zeros(columns + 1)
    cost[-1] = -1.0
    # In forces of the nodes, as entries below 1e-9 are taken for none: elements may be as much shorter than the model.
    length = np.where(mesh.weight > 0, mesh.weight, problem.model.size) / problem.model.size
    by_column = sparse.diags(1 / np.append(np.repeat(length, 2), 1.0))
    by_pair = length[mesh.pairs.slave]
    by_row = np.tile(by_pair[own], len(bounds))
    bounded = sparse.vstack([sparse.diags(by_row) @ above, balance - left, -balance - left])
    found = minimise(
        cost[used],
        A_ub=(bounded @ by_column).tocsr()[:, used],
        b_ub=np.concatenate([by_row * most, spare - constant, spare + constant]),
        A_eq=(sparse.diags(by_pair[parted]) @ fixed @ by_column).tocsr()[:, used] if len(parted) else None,
        b_eq=-by_pair[parted] * pressure[parted] if len(parted) else None,
        bounds=np.stack([low, high], axis=1)[used],
    )  # fmt: skip
    if found.status != SOLVED:
        return _Solved(None, found.status == INFEASIBLE)
    return _Solved(float(np.clip(found.x[-1], 0.0, 1.0)), True)


def _find_strongest(laws: PairLaws, memory: Memory) -> tuple[Real, Real]:
    """Friction and cohesion of all pairs, the largest that their laws know of; cohesion that is lost is none."""
    friction, cohesion = np.zeros(laws.count), np.zeros(laws.count)
    for group in laws.strengths:
        strongest = group.law.find_strongest(group.parameters)
        assert strongest is not None
        friction[group.pairs], cohesion[group.pairs] = strongest
    return friction, np.where(memory.broken, 0.0, cohesion)
