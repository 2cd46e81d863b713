"""Tangent operator against the classical way on the four examples: iterations and time, both by the same code.

The classical way keeps the elastic operator of the closed, sticking contact: it is factorised once, tractions beyond
the contact law are taken back, and what is then out of balance is applied again until it vanishes. Its convergence
rests on a joint stiffness r by which excess tractions become jumps: several are tried, in moduli per element length,
and the one that needs the fewest iterations is shown.

usage: .venv/bin/python scripts/bench_newton.py [--repeat N]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from pbem.case.build import read_model
from pbem.contact.constraints import read_pair_unknowns
from pbem.contact.laws import STICK, ModeState, PairState, evaluate_strength, start_memory
from pbem.contact.loads import Load
from pbem.contact.modes import Linearisation, linearise
from pbem.mesh.generate import generate_mesh
from pbem.model.model import Model
from pbem.parallel import gather_parts, world
from pbem.solve.nonlinear.newton import solve_step
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.step import SilentReporter
from pbem.solve.problem.tangent import TangentOperator
from pbem.solve.steps.march import start_from_rest
from pbem.solve.system.assembly import assemble_problem
from pbem.solve.tangent.factored import FactoredTangent

Real = NDArray[np.float64]
T = TypeVar("T", bound=TangentOperator)

CASES = ("panel_frictionless_closing", "panel_friction_closing", "two_blocks", "layers_push_stiff")
JOINT_STIFFNESSES = (0.125, 0.25, 0.5, 1.0, 2.0)
MOST_ITERATIONS = 20_000


@dataclass(frozen=True)
class Timed:
    """State of the pairs at the end of a solution, its iterations and seconds."""

    pairs: PairState
    iterations: int
    seconds: float


def project(problem: Problem, trial: Real, stiffness: Real, slip_before: Real, load: Load) -> PairState:
    """Tractions allowed by the contact law nearest to trial tractions (m, 2), and jumps from what was taken back."""
    laws = problem.laws
    normal, tangential = trial.T
    limit = np.where(laws.bonded, np.inf, laws.tensile_strength - load.pressure)
    p_n = np.where(normal > limit, -load.pressure, normal)
    none = np.zeros(laws.count)
    strength = evaluate_strength(laws, p_n, start_memory(laws).look_ahead(none), load.pressure)
    bound = np.where(normal > limit, 0.0, np.where(laws.bonded, np.inf, strength.bound))
    p_s = np.clip(tangential, -bound, bound)
    return PairState(p_n, p_s, (normal - p_n) / stiffness, slip_before + (tangential - p_s) / stiffness)


def solve_classically(problem: Problem, tangent: FactoredTangent, load: Load, factor: float) -> tuple[PairState, int]:
    """Converge one step from rest with the constant elastic operator; returns the pairs and the number of iterations.

    factor: joint stiffness in moduli per element length. Diverging iterations count as MOST_ITERATIONS.
    """
    count = problem.mesh.pairs.count
    nothing = np.zeros(count)
    everywhere_stick = ModeState(np.full(count, STICK), np.ones(count))
    rest = start_memory(problem.laws)
    elastic = linearise(
        problem.laws, everywhere_stick, nothing, nothing, rest, load.pressure, problem.traction_scale
    )  # fmt: skip
    constraints = problem.constrain(elastic, load)
    tangent.update(constraints)
    scale = problem.measure(problem.apply(constraints.offset, load))
    modulus = max(region.material.plane_modulus for region in problem.model.regions)
    stiffness = factor * modulus / (3 * problem.mesh.pairs.weight)
    unknowns = np.zeros(problem.unknowns)
    for number in range(1, MOST_ITERATIONS + 1):
        trial = problem.traction_scale * read_pair_unknowns(problem.mesh, unknowns)
        state = project(problem, trial, stiffness, nothing, load)
        offset = np.stack([state.p_n, state.p_s, state.g_n, state.g_s], axis=1)
        given = problem.constrain(Linearisation(np.zeros((count, 4, 2)), offset, problem.laws.leader), load)
        unbalanced = problem.apply(given.evaluate(unknowns), load)
        if problem.measure(unbalanced) <= problem.model.solver.newton_tolerance * scale:
            return state, number - 1
        if not np.abs(unknowns).max() < 1e6 * problem.model.size:
            break
        unknowns -= gather_parts(world, tangent.reference.solve_columns(unbalanced[:, None])[:, 0])
    return state, MOST_ITERATIONS


def solve_by_tangent(problem: Problem, tangent: TangentOperator, load: Load) -> tuple[PairState, int]:
    """Converge one step from rest with the tangent operator; returns the pairs and the number of iterations."""
    solution = solve_step(problem, tangent, start_from_rest(problem).memory, load, SilentReporter())
    return solution.pairs, len(solution.iterations)


def time_best(
    problem: Problem, make: Callable[[Problem], T], solve: Callable[[T], tuple[PairState, int]], repeat: int
) -> Timed:
    """The fastest of some runs, factorisation included."""
    best = np.inf
    for _ in range(repeat):
        begin = time.perf_counter()
        tangent = make(problem)
        pairs, iterations = solve(tangent)
        tangent.destroy()
        best = min(best, time.perf_counter() - begin)
    return Timed(pairs, iterations, best)


def make_factored(problem: Problem) -> FactoredTangent:
    """By GMRES with the factors of earlier modes."""
    return FactoredTangent(problem, problem.system.tangent_rows)


def measure(model: Model, repeat: int) -> str:
    """One line of the table."""
    problem = assemble_problem(model, generate_mesh(model), world)
    load = problem.evaluate_load(0, 1.0)
    newton = time_best(problem, Problem.make_tangent, lambda tangent: solve_by_tangent(problem, tangent, load), repeat)
    trials = {
        factor: time_best(
            problem, make_factored, lambda tangent, f=factor: solve_classically(problem, tangent, load, f), 1
        )
        for factor in JOINT_STIFFNESSES
    }
    factor, classical = min(trials.items(), key=lambda item: item[1].iterations)
    largest = max(np.abs(newton.pairs.g_s).max(), np.abs(newton.pairs.g_n).max(), 1e-300)
    difference = np.abs(newton.pairs.g_s - classical.pairs.g_s).max() / largest
    ended = "" if classical.iterations < MOST_ITERATIONS else " (not converged)"
    return (
        f"{problem.unknowns:9d} {newton.iterations:8d} {newton.seconds * 1e3:9.1f} "
        f"{factor:10.3g} {classical.iterations:8d} "
        f"{classical.seconds * 1e3:10.1f} {classical.iterations / newton.iterations:8.1f} "
        f"{classical.seconds / newton.seconds:8.1f} {difference:11.1e}{ended}"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeat", type=int, default=3, help="runs of each, the fastest counts")
    repeat = parser.parse_args().repeat
    print("one load step from rest; assembly is the same for both and not counted")
    print(f"{'':28s}               tangent            classical                 ratio            slip")
    print(f"{'case':28s}  unknowns      it        ms          r       it         ms       it     time    differs")
    for name in CASES:
        _, model = read_model(Path(__file__).parents[1] / "cases" / f"{name}.toml")
        print(f"{name:28s} {measure(model, repeat)}", flush=True)


if __name__ == "__main__":
    main()
