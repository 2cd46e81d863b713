"""Operators and factors that are kept from one run to the next, for cases that differ in laws and loads alone."""

from __future__ import annotations

import hashlib
from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import Any

import numpy as np
from mpi4py import MPI

from pbem.contact.anchor import anchor_motions
from pbem.contact.laws import PairLaws, collect_laws, find_linear
from pbem.contact.loads import OuterNodes, collect_outer_nodes, find_needed_columns
from pbem.formed import FormedArray
from pbem.mesh.mesh import Mesh
from pbem.model.model import Model
from pbem.model.recall import Recall
from pbem.model.rigid_body_modes import list_hold
from pbem.model.support import find_anchored_motions
from pbem.solve.petsc.session import PETSc
from pbem.solve.problem.problem import Problem, System
from pbem.solve.problem.step import ContactState
from pbem.solve.problem.tangent import TangentOperator
from pbem.solve.steps.march import Guess
from pbem.solve.steps.prediction import History, Place, predict_modes, weigh_histories
from pbem.solve.system.assembly import join_problem
from pbem.solve.system.choice import choose_system

# Of a run and of its second solution on a coarser mesh.
MOST_KEPT = 2
# The states of former cases take up to so many bytes on each rank.
MOST_BYTES = 1 << 28


@dataclass
class _Kept:
    """The last problem of an operator, and its tangent operator once that is made. key, tangent_key: of `digest`.

    hold: what free motions depend on; histories: those that were finished, the last ones of them.
    """

    key: bytes
    problem: Problem
    hold: Hashable
    tangent: TangentOperator | None = None
    tangent_key: bytes = b""
    histories: list[History] = field(default_factory=list)

    def drop_tangent(self) -> None:
        """Free its storage; by all ranks together."""
        if self.tangent is not None:
            self.tangent.destroy()
        self.tangent = None


class KeptProblems:
    """Problems with the operators of earlier ones where these are the same, by the same numbers; for one communicator.

    The operator depends on the mesh, the materials and on which quantities are known, neither on the values of loads
    nor on friction laws. All ranks call all methods together.
    """

    def __init__(self, comm: MPI.Intracomm) -> None:
        self.comm = comm
        self.assembled = 0  # operators so far
        self._recall = Recall()
        self._kept: list[_Kept] = []  # the last one used at the end

    def assemble(self, model: Model, mesh: Mesh) -> Problem:
        """As `assemble_problem`, with a kept operator if there is one. Raises ConvergenceError as it does."""
        outer, laws = collect_outer_nodes(model, mesh), collect_laws(model, mesh)
        hold = list_hold(model)
        anchored = self._recall.find("motions", hold, lambda: find_anchored_motions(model))
        anchors = anchor_motions(mesh, anchored)
        solver = model.solver
        key = digest((
            mesh, [region.material for region in model.regions], model.finite_regions, model.size, outer_parts(outer),
            find_needed_columns(model, mesh, outer), anchors, laws.leader, solver.operator, solver.linear,
            solver.tolerance,
        ))  # fmt: skip
        found = next((each for each in self._kept if each.key == key), None)
        if found is None:
            while len(self._kept) >= MOST_KEPT:
                self._kept.pop(0).drop_tangent()
            system: System = choose_system(model, mesh).assemble(self.comm, model, mesh, outer, laws, anchors)
            self.assembled += 1
        else:
            self._kept.remove(found)
            system = found.problem.system
        problem = join_problem(self.comm, model, mesh, outer, laws, system, anchors, anchored)
        if found is None:
            found = _Kept(key, problem, hold)
        elif found.hold == hold:
            problem = replace(problem, supports=found.problem.supports)
        found.problem, found.hold = problem, hold
        self._kept.append(found)
        return problem

    def take_tangent(self, problem: Problem) -> TangentOperator:
        """The tangent operator for a problem of `assemble`, with the factors of the last one where they serve."""
        found = self._find(problem)
        solver = problem.model.solver
        key = digest((
            varying_parts(problem.laws), solver.newton_tolerance, solver.newton_max_iterations,
            sorted(PETSc.Options().getAll().items()),
        ))  # fmt: skip
        if found.tangent is None or found.tangent_key != key:
            found.drop_tangent()
            if found.tangent_key != key:
                found.histories = []
            found.tangent, found.tangent_key = problem.make_tangent(), key
        else:
            found.tangent.take_over(problem)
        return found.tangent

    def guess_modes(self, problem: Problem, place: Place) -> Guess | None:
        """The modes expected from histories that were finished, where those of a state are known by its tractions.

        Not where laws remember or change with the slip: the way to a state is then part of it.
        """
        laws = problem.laws
        if laws.brittle.any() or not find_linear(laws).all():
            return None
        weighed = weigh_histories(self._find(problem).histories, place)
        return lambda stage, factor, memory, pressure: predict_modes(weighed, laws, stage, factor, memory, pressure)

    def remember(self, problem: Problem, place: Place, states: Mapping[tuple[int, float], ContactState]) -> None:
        """A history is finished; its states by stage and fraction."""
        histories = self._find(problem).histories
        histories.append(History(place, dict(states)))
        while len(histories) > 1 and sum(each.size for each in histories) > MOST_BYTES:
            histories.pop(0)

    def _find(self, problem: Problem) -> _Kept:
        return next(each for each in self._kept if each.problem is problem)

    def forget_factors(self) -> None:
        """After a run that did not converge the next one begins with factors of its own."""
        for each in self._kept:
            each.drop_tangent()

    def destroy(self) -> None:
        """Free the storage."""
        self.forget_factors()
        self._kept = []


def outer_parts(outer: OuterNodes) -> tuple[Any, ...]:
    """What the operator depends on of the conditions, which have their values besides."""
    return outer.node, outer.direction, outer.displacement_known, outer.stiffness, outer.rigid


def varying_parts(laws: PairLaws) -> tuple[Any, ...]:
    """What factors depend on of the laws: which pairs can change."""
    return laws.bonded, laws.parted, laws.leader


def digest(value: Any) -> bytes:
    """A short text that is the same for the same numbers and names only."""
    found = hashlib.sha256()
    _feed(found, value)
    return found.digest()


def _feed(found: Any, value: Any) -> None:
    if isinstance(value, np.ndarray | FormedArray):
        found.update(f"a{value.dtype.str}{value.shape}".encode())
        found.update(np.ascontiguousarray(value).tobytes())
    elif is_dataclass(value) and not isinstance(value, type):
        found.update(type(value).__name__.encode())
        for field in fields(value):
            _feed(found, getattr(value, field.name))
    elif isinstance(value, Mapping):
        found.update(f"m{len(value)}".encode())
        for key, each in value.items():
            _feed(found, key)
            _feed(found, each)
    elif isinstance(value, list | tuple):
        found.update(f"l{len(value)}".encode())
        for each in value:
            _feed(found, each)
    else:
        found.update(f"{type(value).__name__}{value!r};".encode())
