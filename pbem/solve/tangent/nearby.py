"""What offsets of some crack pairs make of these pairs, with the elements near to them alone: for choices of modes.

Pairs that disturb each other are near to each other. Sets of pairs that are far apart are taken as if the others were
not there, and of the model around a set the nearest elements are solved exactly. The modes that follow from that are
judged by a solution of the whole model.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph
from scipy.spatial import cKDTree

from pbem.arrays import Complex, Integer, Real
from pbem.bem.group_sizes import do_cracks_meet
from pbem.contact.complementarity import Response, Subset, take_subset
from pbem.contact.constraints import ConstraintMap
from pbem.contact.deferred_laws import spread_directions
from pbem.contact.laws import ModeState, PairState
from pbem.contact.loads import Load
from pbem.contact.modes import Linearisation, Proposal
from pbem.contact.subset import Settled, settle_subset
from pbem.mesh.mesh import Mesh
from pbem.mesh.numbering import number_components
from pbem.mesh.strips import run_side_by_side
from pbem.parallel import add_up
from pbem.solve.preconditioner.schwarz import SchwarzPreconditioner
from pbem.solve.preconditioner.subdomains import find_nearest
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.tangent import MOST_SETTLED, Settling

# So few pairs are answered for by the whole model: what is left at the end can hang on what is far away.
MOST_ASKED = 12
# Pairs disturb each other within so many lengths of their elements.
REACH = 4.0
# Elements around a set of pairs, as a multiple of the pairs' own, and at least.
AROUND, LEAST_AROUND = 3, 60
# The most pairs that are settled together: each costs two solutions. Of cracks that meet nearby elements answer, and
# sets that are far from each other are settled one by one.
MOST_SETTLED_BY_GMRES = 12


def choose_settling(problem: Problem) -> Settling:
    """Which pairs of a problem with the hierarchical operator are settled together, and by what.

    Where cracks run side by side, those beside the pairs that change join them: contact ends somewhere there. Not in
    networks, whose groups settle by themselves.
    """
    nearby = answers_nearby(problem)
    beside = nearby and not do_cracks_meet(problem.mesh)
    return Settling(MOST_SETTLED if nearby else MOST_SETTLED_BY_GMRES, beside, nearby)


def answers_nearby(problem: Problem) -> bool:
    """Whether pairs of a problem with the hierarchical operator are answered for by what is near to them.

    Cracks that meet or run side by side, and whose bonds do not fail: of such failures the order matters.
    """
    pairs, mesh = problem.mesh.pairs, problem.mesh
    suits = bool(pairs.crack.all() and not problem.laws.brittle.any())
    return suits and (do_cracks_meet(mesh) or run_side_by_side(mesh))


def settle_parts(
    subset: Subset, response: Response, proposed: ModeState, group: Integer, judge: Callable[..., Proposal]
) -> Settled:
    """Modes of the pairs (s,) of a group, each set of them that no other answers to by itself.

    Sets for which none are found take the modes that are proposed (m,). Nothing is said of whether there are any.
    """
    count = subset.laws.count
    links = np.abs(response.change).max(axis=1).reshape(count, count, 2).max(axis=2) > 0
    number, label = csgraph.connected_components(sparse.csr_matrix(links), directed=False)
    mode, sign = proposed.mode[group].copy(), proposed.sign[group].copy()
    wrong, found_any = np.zeros(count, dtype=bool), False
    for each in range(number):
        own = np.flatnonzero(label == each)
        part = take_subset(subset.laws, subset.memory, subset.pressure, subset.modes, own)
        part = replace(part, effort=subset.effort)
        change = response.change[own][:, :, number_components(own)]

        def ask(modes: ModeState, state: PairState, part: Subset = part) -> Proposal:
            return judge(part.laws, modes, state, part.memory, part.pressure)

        found = settle_subset(part, replace(response, values=response.values[own], change=change), ask)
        wrong[own] = found.wrong
        if found.modes is not None:
            mode[own], sign[own], found_any = found.modes.mode, found.modes.sign, True
    return Settled(ModeState(mode, sign) if found_any else None, False, 1, wrong)


def respond_nearby(
    problem: Problem, preconditioner: SchwarzPreconditioner, constraints: ConstraintMap, load: Load,
    law: Linearisation, pairs: Integer, directions: Real,
) -> Real:
    """As TangentOperator.respond, (2 s, 2 s), for crack pairs, after the preconditioner took the same constraints.

    Zero between sets of pairs that are far apart.
    """
    offsets = problem.constrain(spread_directions(law.leader, pairs, directions), load)
    result = np.zeros((2 * len(pairs), 2 * len(pairs)))
    slave = problem.mesh.pairs.slave[pairs]
    tree = cKDTree(_at(0.5 * (problem.mesh.start + problem.mesh.end)))
    for number, members in enumerate(part_by_distance(problem.mesh, slave)):
        if number % problem.comm.size != problem.comm.rank:
            continue
        own = np.unique(problem.mesh.node_element[slave[members]])
        further = find_nearest(problem.mesh, own, tree, max(AROUND * len(own), LEAST_AROUND))
        unknowns = number_components(slave[members])
        at = number_components(members)
        result[np.ix_(at, at)] = preconditioner.respond(
            constraints, offsets, np.union1d(own, further), unknowns
        )
    return add_up(problem.comm, result)


def part_by_distance(mesh: Mesh, nodes: Integer) -> list[Integer]:
    """Sets of places in nodes (k,) that are far from each other."""
    element = mesh.node_element[nodes]
    reach = REACH * np.abs(mesh.end - mesh.start)[element]
    places = _at(mesh.position[nodes])
    near = cKDTree(places).query_ball_point(places, reach)
    row = np.repeat(np.arange(len(nodes)), [len(each) for each in near])
    column = np.concatenate([np.asarray(each, dtype=np.int64) for each in near])
    links = sparse.coo_matrix((np.ones(len(row)), (row, column)), shape=(len(nodes), len(nodes)))
    count, label = csgraph.connected_components(links, directed=False)
    return [np.flatnonzero(label == k) for k in range(count)]


def _at(points: Complex) -> Real:
    return np.column_stack([points.real, points.imag])
