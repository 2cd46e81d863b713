"""The statuses of a contact that is made stiffer in steps, for load steps whose own search does not settle.

Blocks that rest on single pairs, as voussoirs and blocks that topple do near the largest load, are nearly free: an
iteration turns them by far more than there is room for, and takes the statuses of all around with them. With a
compliance in front of the law of every pair, as of an elastic joint, they sink into what they touch until several pairs
hold them, and the statuses come to rest. From these the true contact is searched for in the end.
"""

from __future__ import annotations

from dataclasses import replace

from pbem.contact.laws import Memory, find_linear
from pbem.contact.loads import Load
from pbem.errors import ConvergenceError, StopError
from pbem.solve.nonlinear.checkpoint import Plain, from_plain, to_plain
from pbem.solve.nonlinear.damped import MOST_AT_LAST, can_be_damped, describe_run, find_damped
from pbem.solve.nonlinear.newton import Solution, solve_step
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.step import Iteration, Supervisor
from pbem.solve.problem.tangent import TangentOperator

# Compliances of the pairs, one after the other, in lengths of the pair over the modulus beside it.
SOFTNESS = (1.0, 0.03, 0.001)
# What a search can end with that did not settle.
UNSETTLED = ("iteration limit", "mode cycle", "unsound mesh")


def solve_softly(
    problem: Problem, tangent: TangentOperator, begin: Memory, load: Load, reporter: Supervisor,
    error: ConvergenceError, resumed: Plain | None = None, hurried: bool = False,
) -> Solution | ConvergenceError | None:
    """A load step whose search has ended with an error, by statuses of other contacts; None if these do not settle.

    At first by those of contacts that come to rest against dashpots (see pbem.contact.damped), then by those of softer
    contacts; of larger models it is asked at last whether the bodies move on, where the largest load is near (hurried).
    The solution is one of the true laws, found by their own search. Its iterations are those of all contacts.
    A truer error where the bodies do not come to rest. None, too, for crack networks and large models, whose groups
    settle by themselves, for laws that are not linear in each status, and for other errors. hurried: whether softer
    contacts are left out, as they are where pairs have no admissible modes among which dashpots can look for a state
    of rest. resumed: see solve_step.
    """
    damps, parts = can_be_damped(problem, tangent), error.reason == "no admissible modes"
    unsettled = error.reason in UNSETTLED or parts or error.unless is not None or resumed is not None
    if not unsettled or tangent.settling.nearby or not find_linear(problem.laws).all():
        return None
    contacts = (*(soften(problem, softness) for softness in SOFTNESS), problem)
    damped = resumed if resumed and resumed["damped"] else None
    if not resumed and damps and not error.restless:
        rest = find_damped(problem, tangent, begin, load)
        if rest and rest.runs:
            return describe_run(problem, begin, load, rest.runs)
        if rest and rest.rest:
            damped = {"contact": len(SOFTNESS), "modes": to_plain(rest.rest.modes), "iterations": to_plain([]),
                      "inner": None, "damped": True}
    found = _follow(problem, tangent, contacts, begin, load, reporter, damped) if damped else None
    if not (hurried or (parts and damps)):
        found = found or _follow(problem, tangent, contacts, begin, load, reporter, None if damped else resumed)
    if found or damps or not hurried or not can_be_damped(problem, tangent, MOST_AT_LAST):
        return found
    last = find_damped(problem, tangent, begin, load)
    return describe_run(problem, begin, load, last.runs) if last and last.runs else None


def _follow(
    problem: Problem, tangent: TangentOperator, contacts: tuple[Problem, ...], begin: Memory, load: Load,
    reporter: Supervisor, resumed: Plain | None,
) -> Solution | None:
    """The solution with the last of some contacts, each of which begins with the statuses of the one before."""
    iterations: list[Iteration] = from_plain(resumed["iterations"]) if resumed else []
    guess = replace(begin, modes=from_plain(resumed["modes"])) if resumed else begin
    first, damped = (resumed["contact"], resumed["damped"]) if resumed else (0, False)
    try:
        for number, each in enumerate(contacts):
            if number < first:
                continue
            inner = resumed["inner"] if resumed and number == first else None
            try:
                found = solve_step(each, tangent, guess, load, reporter, hurried=True, once=True, resumed=inner)
            except StopError as stop:
                stop.unfinished = stop.unfinished and stop.unfinished.within(
                    contact=number, modes=to_plain(guess.modes), iterations=to_plain(iterations), damped=damped)
                raise
            iterations += [replace(one, number=len(iterations) + k) for k, one in enumerate(found.iterations, 1)]
            guess = replace(begin, modes=found.modes)
    except ConvergenceError:
        return None
    if problem.comm.rank == 0:
        reporter.note(
            "Statuses of the contacts did not settle by themselves; they were found with a "
            f"{'damping' if damped else 'compliance'} of the contacts that was reduced in steps."
        )
    return replace(found, memory=replace(found.memory, modes=begin.modes), iterations=tuple(iterations))


def soften(problem: Problem, softness: float) -> Problem:
    """The problem with soft pairs (theory, 121); what is known of its bodies stays known."""
    laws = problem.laws
    compliance = softness / laws.own_stiffness
    result = replace(problem, laws=replace(
        laws, compliance_n=laws.compliance_n + compliance, compliance_s=laws.compliance_s + compliance,
    ))  # fmt: skip
    vars(result).update({name: value for name, value in vars(problem).items() if name not in vars(result)})
    return result
