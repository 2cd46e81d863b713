"""Why the modes of a load step did not settle, in words with the pairs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pbem.arrays import Bool, Integer, Real
from pbem.contact.laws import OPEN, ModeState, PairLaws, find_linear
from pbem.contact.modes import Proposal
from pbem.contact.subset import Settled
from pbem.errors import ConvergenceError
from pbem.geometry.junction import format_point
from pbem.model.rigid_body_modes import RigidBodyMode
from pbem.solve.problem.problem import Problem

# So many pairs, or interfaces, are named.
MOST_NAMED = 5
# Where more pairs than this do not settle, it is not for the elements beside them.
MOST_PLACES = 300


@dataclass(frozen=True)
class Unsettled:
    """A search that did not settle, and the motions that are free in its last modes.

    Where some forces of the contacts balance the loads, these modes need not be those of an equilibrium: see
    pbem.solve.steps.ends. error: of the search; None if it ended as no pair held a body of those that were closed, or
    stuck, to do so. may_stick: whether friction of the pairs that are closed could prevent the motions.
    """

    error: ConvergenceError | None
    motions: tuple[RigidBodyMode, ...]
    may_stick: bool = False


def describe_unsettled(
    problem: Problem, reason: str, modes: ModeState, proposal: Proposal, group: Integer, failed: Settled | None,
    pressure: Real,
) -> ConvergenceError:
    """The error of a search that ends, with its reason or a truer one.

    modes, proposal: at last, and what they lead to. group (s,): the pairs for which pivoting found no modes last, with
    what it found; none if it did not fail. pressure (m,): of fluid.
    """
    if not proposal.changed.any():
        return ConvergenceError(reason, "the laws of slipping pairs do not settle; try more load steps")
    is_open, opens = modes.mode == OPEN, proposal.modes.mode == OPEN
    parted = find_friction_under_fluid(problem.laws, pressure) & (is_open | opens)
    parting = parted & proposal.changed & (is_open != opens)
    # Where friction weakens with slip, too, pairs may change for other reasons than that, as long as they touch.
    loses = find_losing(problem.laws) & (find_linear(problem.laws) | (is_open != opens))
    if reason != "iteration limit" and not (reason == "no admissible modes" and failed is not None):
        losing = loses & proposal.changed
        if not losing.any() and not (failed is not None and failed.wrong.any()):
            losing = parting
        if losing.any():
            return _blame_loss(problem, losing, proposal, loses, parting)
    if failed is not None and failed.wrong.any():
        return ConvergenceError(
            "unsound mesh",
            f"single pairs open under compression, or slip against the shear: {_name(problem, group[failed.wrong])}; "
            "with the others in their present modes contact there has none or several solutions; where elements are "
            "longer than the distance to the nearest face, use shorter ones",
            _list_places(problem, group[failed.wrong]),
        )
    if reason == "no admissible modes" and failed is not None:
        certainty = "fulfils" if failed.exhaustive else "was found that fulfils"
        others = "" if len(group) == problem.laws.count else "with the statuses of all other pairs held "
        changing = group[proposal.changed[group]]
        if 0 < len(changing) < len(group):  # at last all pairs are tried, most of which have their modes
            those = f"{len(group)}, {len(changing)} of which {'changes' if len(changing) == 1 else 'change'}"
        else:
            those, changing = f"{len(group)}", group
        return ConvergenceError(
            reason,
            f"{others}no choice of stick, slip and open {certainty} the laws of these {those}: "
            f"{_name(problem, changing)}; {_advise(problem.laws, group, changing, loses, parting, parted)}",
        )
    return ConvergenceError(reason, f"{_describe_changed(problem, proposal)}; try shorter elements there",
                            _list_places(problem, np.flatnonzero(proposal.changed)))


def _advise(laws: PairLaws, group: Integer, changing: Integer, loses: Bool, parting: Bool, parted: Bool) -> str:
    """Why pairs have no modes, and what to do, where they lose what they have back at once; else what may help.

    Of those that change, else of the group: friction alone always has modes, and which of the pairs around the end of
    an opening changes last, and how, is chance. loses, parting: see `_list_losses`; parted (m,): those that are open,
    too.
    """
    losses = _list_losses(laws, changing, loses, parting) or _list_losses(laws, group, loses, parted)
    return "; ".join(losses) or "try shorter elements there, or smaller steps"


def _list_losses(laws: PairLaws, group: Integer | Bool, loses: Bool, parting: Bool) -> list[str]:
    """What some pairs lose where they part and have back where they meet, with what makes it last, or go to zero.

    loses (m,): pairs that lose their strength where they part. parting (m,): those with friction that are to open, or
    to close again, under a fluid that is in open parts alone: where closed ones pull and open ones overlap, which of
    the two comes last is chance.
    """
    losses = []
    if loses[group].any():
        lost = "tensile strength and cohesion are" if (laws.tensile_strength[group] > 0).any() else "cohesion is"
        losses.append(f"{lost} lost at once where faces part, and back where they meet: cohesion_lost = true makes "
                      "that loss last")
    if parting[group].any():
        losses.append("faces part under the fluid's pressure, at which closed ones still have friction, as it is in "
                      'open parts alone: with pressurised = "all" friction goes to zero there')
    return losses + ["it may take both"] * (len(losses) == 2)


def find_losing(laws: PairLaws) -> Bool:
    """The pairs (m,) that have tensile strength or cohesion, lose it where they part, and have it back where they meet.
    """
    losing = laws.tensile_strength > 0
    for group in laws.strengths:
        losing[group.pairs] |= group.parameters.get("cohesion", 0.0) > 0
        losing[group.pairs] &= group.law.pivots_at_slip  # other laws may soften, or mean something else
    return losing & ~laws.brittle


def find_friction_under_fluid(laws: PairLaws, pressure: Real) -> Bool:
    """The pairs (m,) whose friction is not zero where they part, as a fluid of this pressure (m,) is in open parts
    alone: they lose it there, and have it back where they meet."""
    rough = np.zeros(laws.count, dtype=bool)
    for group in laws.strengths:
        by_stress = group.parameters.get("residual_friction_angle", 0.0) > 0  # of rock joints, whatever has slipped
        rough[group.pairs] = (group.parameters.get("friction", 0.0) > 0) & find_linear(laws)[group.pairs] | by_stress
    return rough & (pressure > 0) & ~laws.fluid_inside


def _blame_loss(
    problem: Problem, losing: Bool, proposal: Proposal, loses: Bool, parting: Bool
) -> ConvergenceError:
    """The error where pairs that lose their strength go on changing: what the search made of them last, a cycle or
    pairs of the wrong sign in a body that hangs on two of them, is chance."""
    losses = "; ".join(_list_losses(problem.laws, losing | parting, loses, parting))
    return ConvergenceError(
        "no admissible modes",
        f"{_describe_changed(problem, proposal)}; {losses}; then no "
        "modes may fulfil the laws; where elements are longer than the distance to the nearest face, use shorter ones",
        _list_places(problem, np.flatnonzero(losing)),
    )


def _describe_changed(problem: Problem, proposal: Proposal) -> str:
    names = problem.mesh.interface_names
    numbers, counts = np.unique(problem.mesh.pairs.interface[proposal.changed], return_counts=True)
    first = zip(numbers[:MOST_NAMED], counts[:MOST_NAMED], strict=True)
    where = ", ".join(f"{count} on {names[number]}" for number, count in first)
    worst = np.array([int(np.argmax(proposal.violation))])
    return f"pairs that still change mode: {where}; the worst {_name(problem, worst)}"


def _list_places(problem: Problem, pairs: Integer) -> tuple[complex, ...]:
    """Where these pairs lie; nothing if they are many."""
    if len(pairs) > MOST_PLACES:
        return ()
    return tuple(complex(z) for z in problem.mesh.pairs.position[pairs])


def _name(problem: Problem, pairs: Integer) -> str:
    """Interface and place of the first few pairs."""
    mesh = problem.mesh
    places = [
        f"on {mesh.interface_names[mesh.pairs.interface[pair]]} at "
        f"{format_point(mesh.pairs.position[pair] + problem.model.origin)}"
        for pair in pairs[:MOST_NAMED]
    ]
    more = len(pairs) - len(places)
    return ", ".join(places) + (f" and {more} more" if more else "")
