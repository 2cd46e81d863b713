"""Fields of 150 random cracks that open, slide and stick, and the trap of a trial stiffness that is too large."""

from __future__ import annotations

import cmath
import math
import random
from functools import partial

import numpy as np

from pbem.case.build import parse_model
from pbem.contact import laws
from pbem.contact.laws import OPEN, SLIP, STICK
from pbem.errors import ConvergenceError
from pbem.solve.nonlinear import search
from pbem.solve.problem import tangent
from pbem.solve.problem.step import ContactState
from tests.verification.proofs.proof import (
    Outcome,
    Proof,
    Solved,
    largest_error,
    line,
    solve_model,
    solve_text,
    write_case,
)

COUNT, DENSITY, CLEARANCE = 150, 0.15, 0.1
FRICTION = 0.6
FEW = 60


def scatter_cracks(seed: int, count: int = COUNT) -> list[tuple[complex, complex]]:
    """Ends of cracks of half-length 1 in a square, in random directions, none nearer than CLEARANCE to another."""
    draw = random.Random(seed)
    side = math.sqrt(count / DENSITY)
    cracks: list[tuple[complex, complex]] = []
    while len(cracks) < count:
        center = complex(side * draw.random(), side * draw.random())
        half = cmath.rect(1.0, math.pi * draw.random())
        crack = center - half, center + half
        if all(measure_distance(crack, other) >= CLEARANCE for other in cracks):
            cracks.append(crack)
    return cracks


def measure_distance(one: tuple[complex, complex], other: tuple[complex, complex]) -> float:
    """Least distance of two segments, 0 if they cross."""

    def side(line: tuple[complex, complex], point: complex) -> float:
        return ((line[1] - line[0]).conjugate() * (point - line[0])).imag

    def distance(point: complex, line: tuple[complex, complex]) -> float:
        along = line[1] - line[0]
        fraction = ((point - line[0]) * along.conjugate()).real / abs(along) ** 2
        return abs(point - line[0] - min(max(fraction, 0.0), 1.0) * along)

    crosses = [side(a, b[0]) * side(a, b[1]) < 0 for a, b in ((one, other), (other, one))]
    if all(crosses):
        return 0.0
    return min(*(distance(end, other) for end in one), *(distance(end, one) for end in other))


def write_field(seed: int, count: int = COUNT, order: int = 1, steps: int = 1) -> str:
    """The case: compression 1 along y, tension 0.3 along x, in steps that may not be halved."""
    cracks = {f"c{k}": line(*ends, 4) for k, ends in enumerate(scatter_cracks(seed, count))}
    return write_case(
        {
            "materials": {"rock": {"young": 1e3, "poisson": 0.2}},
            "curves": cracks,
            "regions": {"plane": {"material": "rock", "infinite": True, "cracks": list(cracks)}},
            "interfaces": {name: {"friction": FRICTION} for name in cracks},
            "remote": {"sxx": 0.3, "syy": -1.0},
            "analysis": {"order": order, "steps": steps},
            "solver": {"min_step": 1.0},
        }
    )


def measure_violation(contact: ContactState) -> float:
    """Largest breach of the contact conditions, relative to the largest jump or traction."""
    mode, opening, slip = contact.mode, contact.opening, contact.slip
    normal, tangential = contact.traction_n, contact.traction_s
    stick, slips, is_open = (mode == kind for kind in (STICK, SLIP, OPEN))
    stress = max(np.abs(normal).max(), np.abs(tangential).max())
    length = max(np.abs(opening).max(), np.abs(slip).max())
    excess = np.abs(tangential) + FRICTION * normal
    breaches = {
        "penetration": -opening / length,
        "opening of a closed pair": np.where(is_open, 0, np.abs(opening)) / length,
        "traction of an open pair": np.where(is_open, np.hypot(normal, tangential), 0) / stress,
        "tension": normal / stress,
        "friction beyond the cone": np.where(is_open, 0, excess) / stress,
        "slip within the cone": np.where(slips, np.abs(excess), 0) / stress,
        "slip of a sticking pair": np.where(stick, np.abs(slip), 0) / length,
        "slip against friction": np.where(slips, np.maximum(-slip * np.sign(tangential), 0), 0) / length,
    }
    return float(max(values.max() for values in breaches.values()))


def random_field(seed: int, order: int) -> Outcome:
    """Breach of the contact conditions of one field."""
    solved = solve_text(write_field(seed, order=order))
    (step,) = solved.steps
    counts = [int((step.contact.mode == kind).sum()) for kind in (STICK, SLIP, OPEN)]
    assert min(counts) > 0.01 * sum(counts)
    remark = f"{len(step.iterations)} iterations; {counts[0]} stick, {counts[1]} slip, {counts[2]} open"
    return Outcome(measure_violation(step.contact), solved.unknowns, remark)


def many_steps() -> Outcome:
    """Slips and openings of a load in five steps against one: all grows in proportion, whatever friction remembers."""
    one, five = (solve_text(write_field(1, FEW, steps=steps)) for steps in (1, 5))
    assert len(five.steps) == 5
    np.testing.assert_array_equal(one.last.contact.mode, five.last.contact.mode)
    errors = [
        largest_error(getattr(five.last.contact, name), values, float(np.abs(values).max()))
        for name in ("opening", "slip", "traction_n", "traction_s")
        for values in [getattr(one.last.contact, name)]
    ]
    return Outcome(max(errors), one.unknowns)


def solve_stiffly(text: str, factor: float, most_pivoted: int) -> Solved | str:
    """The solution with the trial stiffness of the mode choice multiplied; the reason if there is none.

    most_pivoted: pairs; with 0 the search makes plain Newton steps only.
    """
    usual = laws.SOFTNESS, tangent.MOST_SETTLED, search.GLOBALISATIONS, search.MOST_IF_STUCK
    laws.SOFTNESS, tangent.MOST_SETTLED, search.GLOBALISATIONS = factor * usual[0], most_pivoted, usual[2][:1]
    search.MOST_IF_STUCK = min(most_pivoted, search.MOST_IF_STUCK)
    try:
        return solve_model(parse_model(text)[1])
    except ConvergenceError as error:
        return error.reason
    finally:
        laws.SOFTNESS, tangent.MOST_SETTLED, search.GLOBALISATIONS, search.MOST_IF_STUCK = usual


def stiff_trials(factor: float) -> Outcome:
    """Share of the pairs with other modes than usual, where switching without pivoting goes round for ever."""
    text = write_field(1, FEW)
    usual = solve_text(text)
    assert solve_stiffly(text, factor, 0) == "mode cycle"
    solved = solve_stiffly(text, factor, tangent.MOST_SETTLED)
    if isinstance(solved, str):
        return Outcome(1.0, usual.unknowns, solved)
    other = float((solved.last.contact.mode != usual.last.contact.mode).mean())
    return Outcome(other, solved.unknowns, f"{len(solved.last.iterations)} iterations")


PROOFS = (
    *(Proof(f"field of {COUNT} random cracks, order {order}, number {seed}: contact conditions", "complementarity",
            1e-8, partial(random_field, seed, order))
      for order, seeds in ((1, range(1, 11)), (2, (1,)))
      for seed in seeds),
    Proof(f"field of {FEW} random cracks, load in five steps: jumps, tractions", "invariance", 1e-8, many_steps),
    *(Proof(f"trial stiffness {factor:g} times too large: pairs in other modes", "usual stiffness", 0.0,
            partial(stiff_trials, factor))
      for factor in (80.0, 800.0, 8000.0, 1e6)),
)  # fmt: skip
