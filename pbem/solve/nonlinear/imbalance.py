"""What is said of forces that do not balance: how much is worth a note, and what makes a result wrong."""

from __future__ import annotations

import numpy as np

from pbem.arrays import Real
from pbem.contact.cut_parts import name_part
from pbem.errors import ConvergenceError
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.step import Balance
from pbem.wording import write_percent

# Left-over parts of the sum of all forces on a region that are noted, that mean that a body does not stay where its
# anchors hold it, and that make a result wrong, where they are more than WEIGHTY of those on the most loaded region.
NOTED, DRIVEN, NOT_IN_BALANCE, WEIGHTY = 1e-3, 3e-2, 1e-1, 1e-2
# Bodies that slip all around are driven, too, by this part of their friction, which would stop them. What is more than
# all of it no friction can stop: meshes leave it over.
STOPPED = 0.3
# The same of a net force on an infinite region that prescribed displacements or springs bring about.
NET_FORCE = 1e-2
# Parts that cracks cut off are judged if they carry more than this part of what the most loaded region does.
SLIGHT = 1e-2
# Of what is as large as the largest but for this part the first is named: a region that all forces act on lacks as much
# as the whole model does, and the order of sums, which ranks have their own of, is not to choose.
ALIKE = 1e-6


def are_driven(balance: Balance, friction: Real) -> bool:
    """Whether anchors carry more of the forces on a region than a mesh leaves over, or than its friction lets pass.

    friction (regions,): see measure_friction.
    """
    stopped = (friction > NOTED) & (balance.carried > STOPPED * friction) & (balance.carried <= friction)
    return bool((stopped | (balance.carried > DRIVEN)).any())


def describe_imbalance(problem: Problem, balance: Balance) -> str | None:
    """What is left over on the worst region, part or on the whole, where that is worth a note; None if it is not.

    Raises ConvergenceError where it makes the result wrong: "not in balance", or "net force" of an infinite region.
    """
    _refuse_net_force(problem, balance)
    parts = problem.cut_parts
    relative = np.concatenate([balance.relative, balance.part_relative, [balance.whole_relative]])
    weight = np.concatenate([balance.weight, balance.part_weight, [1.0]])
    # Slivers between cracks carry little, of which much may be left over.
    relative[len(balance.relative) :][weight[len(balance.relative) :] < SLIGHT] = 0.0
    wrong = (relative > NOT_IN_BALANCE) & (relative * weight > WEIGHTY)
    judged = np.where(wrong, relative, 0.0) if wrong.any() else relative
    worst = int(np.argmax(judged >= (1 - ALIKE) * judged.max()))
    amount, at = float(relative[worst]), worst - len(balance.relative)
    if amount <= NOTED:
        return None
    x, y, moment = np.concatenate([balance.resultant, balance.part_resultant, balance.whole[None]])[worst]
    if at < 0:
        on = f"region '{problem.mesh.region_names[worst]}'"
    elif at < len(parts):
        on = f"'{name_part(problem.mesh, problem.parts, int(parts[at]), problem.model.origin)}'"
    else:
        on = "the whole model"
    left = (
        f"the forces on {on} do not balance: ({x:.3g}, {y:.3g}) and a moment of {moment:.3g} are left, "
        f"{write_percent(amount)} % of their sum without signs"
    )
    if at < 0 and float(balance.carried[worst]) > WEIGHTY:
        left += ", which only the condition on its mean motion carries"
    if wrong.any():
        raise ConvergenceError("not in balance", f"{left}; use shorter elements, or order 2, near to it")
    return left


def _refuse_net_force(problem: Problem, balance: Balance) -> None:
    """Raise ConvergenceError if displacements that are prescribed push against an infinite region.

    What they move it by grows with the logarithm of the distance to which it is looked at, and so does without bound
    the force that an answer to them would take.
    """
    conditions = problem.model.conditions.values()
    if not any("displacement" in each.known or any(each.stiffness) for each in conditions):
        return
    for number, region in enumerate(problem.model.regions):
        amount = float(balance.relative[number])
        if region.infinite and amount > NET_FORCE and amount * balance.weight[number] > NET_FORCE:
            x, y, _ = balance.resultant[number]
            raise ConvergenceError(
                "net force",
                f"prescribed displacements or springs act on the infinite region '{region.name}' with a net force of "
                f"({x:.6g}, {y:.6g}), {write_percent(amount)} % of the sum of all forces there without signs; the "
                "displacement of a net force grows with the logarithm of the distance, so that these conditions "
                "determine neither it nor their reactions; prescribe displacements whose forces balance, or "
                "tractions that do, or a stiff inclusion in place of a hole held at rest, or take a finite region",
            )
