"""What a proof is: a problem with a known answer, solved by the program from the text of a case file."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbem.bem.hoop import evaluate_hoop_stress
from pbem.case.build import parse_model
from pbem.mesh.generate import generate_mesh
from pbem.mesh.mesh import Mesh
from pbem.model.model import Model, Operator
from pbem.parallel import world
from pbem.results.energy import Energy, EnergyBalance
from pbem.results.tips import collect_tip_rules
from pbem.solve.problem.particular_solutions import evaluate_particular_solutions
from pbem.solve.problem.step import InteriorValues, SilentReporter, Step
from pbem.solve.steps.march import march
from pbem.solve.system.assembly import assemble_problem
from pbem.solve.system.interior import InteriorField

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]
Integer = NDArray[np.int64]
Table = Mapping[str, Any]


@dataclass(frozen=True)
class Outcome:
    """What was measured: the error in the terms of the proof, the unknowns of the (largest) system, and a remark."""

    error: float
    unknowns: int
    remark: str = ""


@dataclass(frozen=True)
class Proof:
    """A claim about the program that can be measured.

    name: what is proved, unique. source: of the exact answer. tolerance: largest error allowed, relative unless the
    name says otherwise. run: solves and measures.
    """

    name: str
    source: str
    tolerance: float
    run: Callable[[], Outcome]


@dataclass(frozen=True)
class Solved:
    """A solved case with all its steps."""

    model: Model
    mesh: Mesh
    steps: tuple[Step, ...]

    @property
    def unknowns(self) -> int:
        return 2 * self.mesh.nodes

    @property
    def last(self) -> Step:
        return self.steps[-1]

    def pairs(self, name: str) -> Integer:
        """The pairs of an interface, crack or contact, by arc length."""
        return np.flatnonzero(self.mesh.pairs.interface == self.mesh.interface_names.index(name))

    def nodes(self, curve: str) -> Integer:
        """The nodes of a curve that bounds one region."""
        return np.flatnonzero(self.mesh.node_curve == self.mesh.curve_names.index(curve))

    def factors(self, crack: str, step: int = -1) -> tuple[Real, Real]:
        """KI and KII (2,) at the start and the end of a crack."""
        return collect_tip_rules(self.model, self.mesh).evaluate(self.steps[step].contact)[crack]

    def reaction(self, curve: str, step: int = -1) -> complex:
        """Integral of the traction over a curve that bounds one region."""
        nodes = self.nodes(curve)
        return complex(self.mesh.weight[nodes] @ self.steps[step].traction[nodes])

    def interior(self, points: Complex, step: int = -1) -> InteriorValues:
        """Displacement and stress at points (q,)."""
        model = replace(self.model, interior_points=tuple(complex(point) for point in points))
        return InteriorField(model, self.mesh, world).evaluate(self.steps[step])

    def hoop_stress(self, step: int = -1) -> Real:
        """At the nodes of all faces."""
        one = self.steps[step]
        initial = [each for each, _ in evaluate_particular_solutions(self.model, one.stage, one.factor)]
        return evaluate_hoop_stress(self.mesh, initial, one.displacement, one.traction)

    def energies(self) -> list[Energy]:
        """After every step."""
        balance = EnergyBalance(self.model, self.mesh)
        return [balance.add(step) for step in self.steps]


# The operator that all proofs are solved with; None: what each model says. Set before the first proof.
operator: Operator | None = None


def solve_model(model: Model) -> Solved:
    """All converged steps of a model."""
    if operator is not None:
        model = replace(model, solver=replace(model.solver, operator=operator))
    mesh = generate_mesh(model)
    return Solved(model, mesh, tuple(march(assemble_problem(model, mesh, world), SilentReporter())))


@cache
def solve_text(text: str) -> Solved:
    """The solution of a case file's text; remembered, since several proofs look at the same solution."""
    return solve_model(parse_model(text)[1])


def solve_case(**tables: Any) -> Solved:
    """The solution of a case by its tables."""
    return solve_text(write_case(tables))


def write_case(tables: Table) -> str:
    """The text of a case file; numbers keep all their digits."""
    plain = [f"{name} = {_inline(value)}" for name, value in tables.items() if not isinstance(value, Mapping)]
    for name, value in tables.items():
        if isinstance(value, Mapping):
            plain += [f"[{name}]", *(f"{key} = {_inline(entry)}" for key, entry in value.items())]
    return "\n".join(plain) + "\n"


def _inline(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_inline(entry)}" for key, entry in value.items()) + " }"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, complex):
        return _inline([value.real, value.imag])
    if isinstance(value, Sequence | np.ndarray):
        return "[" + ", ".join(_inline(entry) for entry in value) + "]"
    return repr(value.item() if isinstance(value, np.generic) else value)


def line(start: complex, end: complex, elements: int, grading: str = "auto", power: float = 3.0) -> dict[str, Any]:
    """A straight curve."""
    return {"points": [complex(start), complex(end)], "elements": elements, "grading": grading, "power": power}


def largest_error(found: object, exact: object, scale: float | None = None) -> float:
    """Largest difference, relative to the exact values one by one, or to one scale for all."""
    found, exact = np.broadcast_arrays(np.asarray(found), np.asarray(exact))
    by = np.abs(exact) if scale is None else scale
    return float(np.max(np.abs(found - exact) / by))
