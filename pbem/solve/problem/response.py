"""States that some pairs can have while all others keep their modes, by solutions with the present tangent."""

from __future__ import annotations

import numpy as np

from pbem.arrays import Integer, Real
from pbem.contact.complementarity import Response
from pbem.contact.constraints import ConstraintMap, evaluate_pairs
from pbem.contact.deferred_laws import spread_directions
from pbem.contact.loads import Load
from pbem.contact.modes import Linearisation
from pbem.mesh.numbering import number_components
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.tangent import Solved, TangentOperator


def find_response(
    problem: Problem, tangent: TangentOperator, constraints: ConstraintMap, load: Load, law: Linearisation,
    solved: Solved, pairs: Integer,
) -> Response:
    """The response of pairs (s,) to all that their own laws could demand; all ranks together.

    A pair's state is q = T x + o in its present mode. With C the two columns that complete T to a basis of all states,
    q = T (x + dx) + o + C d, where K dx = -B E C d answers to the offsets d: two solutions for each pair.
    """
    tangent_of_pairs = law.take(pairs).tangent
    complement = complete_states(tangent_of_pairs, problem.traction_scale)
    effect = tangent.respond(constraints, load, law, pairs, complement)
    count = len(pairs)
    change = np.einsum("mij,mjk->mik", tangent_of_pairs, effect.reshape(count, 2, 2 * count))
    own = np.arange(count)
    for j in range(2):
        change[own, :, 2 * own + j] += complement[:, :, j]
    state = evaluate_pairs(problem.mesh, law, solved.unknowns)
    values = np.stack([state.p_n, state.p_s, state.g_n, state.g_s], axis=1)
    unit = float(np.abs(values[:, :2]).max(initial=0.0)) or problem.traction_scale * problem.model.size
    units = np.array([unit, unit, unit / problem.traction_scale, unit / problem.traction_scale])
    return Response(values[pairs] / units, change / units[:, None], unit, unit / problem.traction_scale)


def complete_states(tangent: Real, traction_scale: float) -> Real:
    """Two further columns (s, 4, 2), orthogonal to the tangents' (s, 4, 2) in units of one size."""
    units = np.array([traction_scale, traction_scale, 1.0, 1.0])
    further: Real = np.linalg.svd(tangent / units[:, None])[0][:, :, 2:] * units[:, None]
    return further


def select_states(
    problem: Problem, load: Load, law: Linearisation, pairs: Integer, directions: Real
) -> tuple[Real, Integer]:
    """v (4 nodes, 2 s) of offsets of pairs (s,) along directions (s, 4, 2), and the pairs' own unknowns (2 s,)."""
    constraints, unknowns = spread_states(problem, load, law, pairs, directions)
    # The carriers' displacements are columns of their own: those of the pairs' unknowns are their states alone.
    return constraints.matrix[:, unknowns].toarray(), unknowns


def spread_states(
    problem: Problem, load: Load, law: Linearisation, pairs: Integer, directions: Real
) -> tuple[ConstraintMap, Integer]:
    """The map of which the columns of the pairs' own unknowns (2 s,), and these, are those of `select_states`."""
    constraints = problem.constrain(spread_directions(law.leader, pairs, directions), load)
    return constraints, number_components(problem.mesh.pairs.slave[pairs])
