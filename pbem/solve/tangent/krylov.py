"""The linear systems of the hierarchical operator: GMRES on K x = B (M x), preconditioned by overlapping groups."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pbem.arrays import Integer, Real
from pbem.clock import clock
from pbem.contact.constraints import ConstraintMap
from pbem.contact.laws import Memory, ModeState
from pbem.contact.loads import Load
from pbem.contact.modes import Linearisation
from pbem.heap import heap
from pbem.parallel import add_up, gather_parts
from pbem.solve.petsc.minimal_residual import MinimalResidual
from pbem.solve.petsc.session import PREFIX, PETSc, pass_over_divergence
from pbem.solve.preconditioner.schwarz import SchwarzPreconditioner
from pbem.solve.preconditioner.subdomains import Subdomain
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.response import spread_states
from pbem.solve.problem.tangent import Judge, Settling, Solved, TangentOperator, size_residual
from pbem.solve.tangent.clusters import Clusters
from pbem.solve.tangent.krylov_calls import (
    Preconditioning,
    Product,
    Rows,
    carry_solution,
    describe_unsolved,
    is_unsolved,
    refuse_unsolved,
    take_options,
)
from pbem.solve.tangent.local_contact import LocalContact
from pbem.solve.tangent.nearby import MOST_ASKED, choose_settling, respond_nearby
from pbem.solve.tangent.part_inverses import PartInverses
from pbem.solve.tangent.shared_product import SharedProduct, SharedRows

# Most iterations of GMRES for one linear system, without restart.
MOST_ITERATIONS = 300
# GMRES is started at most so often for one linear system.
MOST_ATTEMPTS = 4
# After a system of more iterations than this the groups of the preconditioner take in more around them: each time
# WIDENING times as much, up to MOST_WIDENING times.
SLOW = 60
WIDENING, MOST_WIDENING = 4, 16
# Other friction in a further case changes the operator a little in every group: the inverses of the former one serve
# until the constraint map has changed by this part.
MOST_DRIFT = 0.9
# GMRES goes on to this part of Newton's tolerance: two ways to a state then leave less than 1e-9 between its fields.
SAFETY = 0.03
# Systems whose inverses of parts serve worse than in so many iterations are gone on with by those of the groups.
MOST_BY_PARTS = 150
# Responses of single pairs are found to this part of their forces.
RESPONSE = 3e-2


@dataclass(frozen=True)
class _Iterate:
    """An approximate solution under a load: this rank's part of it, and of its residual K x + B m.

    scale: the norm of the forces B m.
    """

    load: Load | None
    part: Real
    residual: Real
    scale: float


class KrylovTangent(TangentOperator):
    """The tangent operator K = B M as a PETSc shell; its preconditioner follows the modes."""

    def __init__(
        self, problem: Problem, shared: SharedRows, preconditioner: SchwarzPreconditioner,
        groups: Sequence[Subdomain], widen: Callable[[int], Sequence[Subdomain]],
    ) -> None:
        """shared: the problem's system of equations. groups: of the preconditioner; widen: makes them with so many
        times as many elements around them."""
        self.problem = problem
        self.preconditioner = preconditioner
        self.product, self._shared = SharedProduct(problem, shared), shared
        self._groups, self._widen_groups = groups, widen
        self.constraints: ConstraintMap | None = None
        # Whole: what is remembered is stored, and taken up on any number of ranks.
        self.solution: Real | None = None
        self.law: Linearisation | None = None
        # States (m, 4) of the pairs that the next solution begins from, once; else those of the last solution.
        self.expected: Real | None = None
        self.iterations: list[int] = []
        self._settling = choose_settling(problem)
        self.widening = 1
        sizes = ((2 * len(problem.system.nodes), problem.unknowns),) * 2
        self._local = LocalContact(problem, preconditioner, self.product, groups)
        self._parts, self._by_parts = PartInverses(problem), False
        self._matrix = PETSc.Mat().createPython(sizes, Product(self), comm=problem.comm)
        self._matrix.setUp()
        self._right, self._left = self._matrix.createVecs()
        solver = PETSc.KSP().create(problem.comm)
        solver.setOptionsPrefix(PREFIX)
        solver.setOperators(self._matrix)
        self._space = MinimalResidual(problem.comm, Rows(self), MOST_ITERATIONS)
        self._stop: Callable[[], None] = lambda: None
        solver.setType("python")
        solver.setPythonContext(self._space)
        solver.setTolerances(rtol=SAFETY * problem.model.solver.newton_tolerance, atol=0.0, max_it=MOST_ITERATIONS)
        solver.getPC().setType("python")
        solver.getPC().setPythonContext(Preconditioning(self))
        self._keeps_directions = take_options(solver, MOST_ITERATIONS)
        # The user's ksp_rtol and ksp_atol, if they are given.
        self._tolerance, self._least = (float(each) for each in solver.getTolerances()[:2])
        self._solver, self._now = solver, _Iterate(None, np.zeros(0), np.zeros(0), 0.0)

    @property
    def settling(self) -> Settling:
        """See TangentOperator."""
        return self._settling

    def solve(
        self, constraints: ConstraintMap, load: Load, law: Linearisation | None = None, forcing: float = 0.0
    ) -> Solved:
        """See TangentOperator. Raises ConvergenceError: "linear solver"."""
        loosely = forcing > 0 and self._keeps_directions
        self._by_parts = loosely and law is not None and self._parts.suit(law)
        self._move_on(constraints, load, law)
        self.constraints, self._space.residual = constraints, np.zeros(0)
        begin = None if self.solution is None else self.solution.reshape(-1, 2)[self.problem.system.nodes].ravel()
        if begin is not None and law is not None and self.law is not None:
            begin = carry_solution(self.problem, begin, self.law, law, self.expected)
            self.expected = None
        self.law = law
        self._now = self._begin(load, begin, loosely)
        if self._now.scale == 0.0:
            return Solved(np.zeros(self.problem.unknowns), 0.0)
        return self._solve_loosely(constraints, forcing) if loosely else self._complete(constraints, load)

    def _move_on(self, constraints: ConstraintMap, load: Load, law: Linearisation | None) -> None:
        """Make preconditioner and GMRES ready for a constraint map; directions of the same operator serve on."""
        self._take_map(constraints)
        if self._by_parts and law is not None:
            self.preconditioner.pass_over(constraints)
            self._parts.form(law, self._local.divide(load).parts)
        else:
            self.preconditioner.update(constraints)
        heap.give_back()

    def _take_map(self, constraints: ConstraintMap) -> None:
        """Take a constraint map; the directions of GMRES are dropped where they are those of another operator."""
        if self.product.take_map(constraints):
            self._space.forget()
            heap.give_back()

    def _begin(self, load: Load, begin: Real | None, loosely: bool) -> _Iterate:
        """The first iterate, from this rank's part of unknowns that are nearly the solution.

        Other loads or modes can make these much worse than none: that multiple is taken whose product is nearest to the
        right-hand side (theory, 110); loosely, under the same load: as they are, if that is no worse than none.
        """
        problem, rows = self.problem, self.problem.system.nodes
        if begin is not None:
            residual = self.product.balance(self.product.evaluate(begin), load)
            if loosely and self._now.load is load and 0 < problem.measure(residual) <= self._now.scale:
                return _Iterate(load, begin, residual, self._now.scale)
        forced = self.product.balance(self.product.evaluate(None), load)
        scale = problem.measure(forced)
        if begin is None:
            return _Iterate(load, np.zeros(2 * len(rows)), forced, scale)
        product = residual - forced
        sums = add_up(problem.comm, np.array([-(product @ forced), product @ product]))
        factor = sums[0] / sums[1] if sums[1] > 0 else 0.0
        return _Iterate(load, factor * begin, forced + factor * product, scale)

    def _solve_loosely(self, constraints: ConstraintMap, forcing: float) -> Solved:
        """Until the residual is only this part of what it is (theory, 88); its true size is not asked for.

        Raises ConvergenceError: "linear solver".
        """
        goal = max(forcing * self.problem.measure(self._now.residual), self._tolerance * self._now.scale)
        now, count = self._improve(self._now, goal), 0
        if self._by_parts and is_unsolved(self._solver):
            self._by_parts, count = False, self.iterations[-1]
            self.preconditioner.update(constraints)
            now = self._improve(now, goal)
        refuse_unsolved(self._solver, forcing)
        off, left = self.preconditioner.correct(now.residual)
        self._now = replace(now, part=now.part - off, residual=self.preconditioner.turn_back(left))
        unknowns = self.solution = self.gather(self._now.part)
        residual = self.problem.measure(left) / size_residual(now.scale, unknowns, self.product.measure_given())
        count += self.iterations[-1]
        return Solved(unknowns, residual, False, count, loosely=True)

    def _complete(self, constraints: ConstraintMap, load: Load) -> Solved:
        """The solution to the tolerance, from the iterate on."""
        problem, tolerance, now = self.problem, self.problem.model.solver.newton_tolerance, self._now
        residual, count, anew, given = np.inf, 0, False, self.product.measure_given()
        for _ in range(MOST_ATTEMPTS):
            before = residual
            now = self._improve(now, self._tolerance * now.scale)
            count += self.iterations[-1]
            if not self._keeps_directions:
                now = replace(now, residual=self.product.balance(self.product.evaluate(now.part), load))
            # The tractions of crack pairs are those of the jumps to rounding: pairs are judged by them.
            off, _ = self.preconditioner.correct(now.residual)
            part = now.part - off
            unknowns = self.gather(part)
            now = replace(now, part=part, residual=self.product.balance(self.product.evaluate(part), load))
            residual = problem.measure(now.residual) / size_residual(now.scale, unknowns, given)
            solved = residual <= tolerance
            widened = self.iterations[-1] > SLOW and self._widen()
            if widened:  # when solved, too: `respond` goes on with the same constraint map
                self.preconditioner.update(constraints)
                self._solver.getPC().setUp()
            if solved:
                self.solution, self._now = unknowns, now
                return Solved(unknowns, residual, linear_iterations=count)
            # Of slender bodies GMRES' own residual is off by rounding: on from the true one, once without directions.
            helps = residual < 0.1 * before
            if not widened and (self.iterations[-1] >= self._solver.getTolerances()[3] or (anew and not helps)):
                break
            if not helps:
                anew = True
                self._space.forget()
        singular = int(add_up(problem.comm, np.array([float(self.preconditioner.singular)]))[0])
        raise describe_unsolved(residual, count, tolerance, (self._tolerance, SAFETY * tolerance), singular)

    def _improve(self, now: _Iterate, goal: float) -> _Iterate:
        """The iterate after GMRES, ended where the norm of the residual is at the goal."""
        self._right.setArray(-now.residual)
        self._left.set(0.0)
        usual = self._solver.getTolerances()
        most = min(usual[3], MOST_BY_PARTS) if self._by_parts else usual[3]
        self._solver.setTolerances(rtol=0.0, atol=max(goal, self._least), max_it=most)
        try:
            self._run_gmres()
        finally:
            self._solver.setTolerances(*usual)
        self.iterations.append(int(self._solver.getIterationNumber()))
        return replace(now, part=now.part + np.array(self._left.getArray()), residual=-self._space.residual)

    def _run_gmres(self) -> None:
        """Improve the left vector for the right one; whether it is good enough is measured by the callers."""
        with clock.piece("GMRES", 8.0 * self._right.getLocalSize()), pass_over_divergence():
            self._solver.solve(self._right, self._left)
        if self._space.stopped:
            self._stop()

    def _widen(self) -> bool:
        """Let the groups of the preconditioner take in more around them; whether there was more to take.

        Factors of all bodies together that serve badly give way to groups.
        """
        if self.preconditioner.whole:
            self.preconditioner.give_up()
            return True
        wider = self.widening * WIDENING
        if wider > MOST_WIDENING:
            return False
        groups = self._widen_groups(wider)
        before = sum(len(inverse.around) for inverse in self.preconditioner.inverses)
        more = 2 * (self.problem.mesh.order + 1) * sum(len(group.around) for group in groups) > before
        if not add_up(self.problem.comm, np.array([float(more)]))[0]:
            return False
        self.widening = wider
        self.preconditioner.regroup(groups, wider)
        return True

    def check(self, solved: Solved, constraints: ConstraintMap, load: Load, law: Linearisation) -> Solved:
        """See TangentOperator; what was solved loosely is gone on with."""
        if solved.checked:
            return solved
        self._take_map(constraints)
        forced = self.product.balance(self.product.evaluate(None), load)
        self._now = replace(self._now, scale=self.problem.measure(forced))
        full = self._complete(constraints, load)
        return replace(full, linear_iterations=solved.linear_iterations + full.linear_iterations)

    def respond(
        self, constraints: ConstraintMap, load: Load, law: Linearisation, pairs: Integer, directions: Real
    ) -> Real:
        """See TangentOperator; to RESPONSE of the forces only, as the modes that follow are judged by a full solution.

        Of cracks that meet, where the pairs are many, with the elements near to them alone.
        """
        self.constraints = constraints
        self._take_map(constraints)
        if self.settling.nearby and len(pairs) > MOST_ASKED:
            return respond_nearby(self.problem, self.preconditioner, constraints, load, law, pairs, directions)
        spread, unknowns = spread_states(self.problem, load, law, pairs, directions)
        states = self.product.take_seen(spread)[:, unknowns].tocsc()
        result = np.empty((len(unknowns), len(unknowns)))
        usual = self._solver.getTolerances()
        self._solver.setTolerances(rtol=RESPONSE, atol=0.0)
        for k in range(states.shape[1]):
            result[:, k] = self._find_unknowns(-self.product.apply(states[:, [k]].toarray()[:, 0]))[unknowns]
        self._solver.setTolerances(*usual)
        return result

    def sweep(
        self, constraints: ConstraintMap, modes: ModeState, memory: Memory, load: Load, law: Linearisation,
        solved: Solved, judge: Judge,
    ) -> ModeState:
        """See TangentOperator; the next solution begins from the states that go with the modes."""
        settled, self.expected = self._local.divide(load).settle(modes, memory, load, law, solved, judge)
        return settled

    def expect(self, states: Real) -> None:
        """See TangentOperator."""
        self.expected = states

    def find_clusters(self, load: Load) -> Clusters | None:
        """See TangentOperator."""
        return self._local.find_clusters(
            load, lambda: self._space.must_stop() and self._stop()) if self.settling.nearby else None

    def gather(self, part: Real) -> Real:
        """A vector of two values a node (2 nodes,) on every rank, from the ranks' parts."""
        if self.problem.comm.size == 1:
            return part
        # The ranks' own nodes are those of their own elements, rising.
        owner = self._shared.share.of_element
        whole = np.empty((len(owner), 2 * (self.problem.mesh.order + 1)))
        whole[np.argsort(owner, kind="stable")] = gather_parts(self.problem.comm, part).reshape(whole.shape)
        return whole.ravel()

    def evaluate(self, solved: Solved, constraints: ConstraintMap) -> Real:
        """See TangentOperator; each rank forms the map of its own nodes."""
        own = self.problem.system.nodes
        part = constraints.take_rows(own) @ solved.unknowns + constraints.take_offset(own)
        return np.concatenate([self.gather(half) for half in part.reshape(2, -1)])

    def multiply(self, part: Real) -> Real:
        """This rank's rows of B M x for its part of x."""
        return self.product.multiply(part)

    def precondition(self, part: Real) -> Real:
        """This rank's part of the preconditioned residual, for its part of the residual."""
        if self._by_parts:
            return self._parts.apply(self.product.surround(part, self._parts.beyond))
        result, inner = np.zeros(len(part)), self.preconditioner
        inner.apply(part if inner.whole else self.product.surround(part, inner.beyond), result)
        return result

    def solve_forces(self, constraints: ConstraintMap, load: Load, law: Linearisation, forces: Real) -> Real:
        """See TangentOperator; without the anchors that the constraint map releases."""
        self.constraints = constraints
        self._take_map(constraints)
        return self._find_unknowns(forces)

    def _find_unknowns(self, forces: Real) -> Real:
        """The unknowns on every rank for this rank's part of a right-hand side, as good as the solver is set to."""
        self._right.setArray(forces)
        self._left.set(0.0)
        self._run_gmres()
        part = np.array(self._left.getArray())
        if self._keeps_directions:
            # GMRES ends by the equations that contain no eliminated unknowns; these follow from the others.
            part -= self.preconditioner.correct(-self._space.residual)[0]
        return self.gather(part)

    def listen(self, must_stop: Callable[[], bool], stop: Callable[[], None]) -> None:
        """See TangentOperator; a solver that the user has chosen in place of our own does not ask."""
        self._space.must_stop, self._stop = must_stop, stop

    def remember(self, load: Load) -> Mapping[str, Any]:
        """See TangentOperator."""
        scale = self._now.scale if self._now.load is load else 0.0
        return {"solution": self.solution, "law": self.law, "expected": self.expected, "scale": scale,
                "widening": self.widening}

    def recall(self, remembered: Mapping[str, Any], load: Load) -> None:
        """See TangentOperator."""
        self.solution, self.law, self.expected = (remembered[name] for name in ("solution", "law", "expected"))
        if remembered["scale"]:
            self._now = _Iterate(load, np.zeros(0), np.zeros(0), remembered["scale"])
        self._space.forget()
        while self.widening < remembered["widening"] and self._widen():
            pass

    def take_over(self, problem: Problem) -> None:
        """See TangentOperator."""
        self.problem, self.expected, self._parts = problem, None, PartInverses(problem)
        self._local = LocalContact(problem, self.preconditioner, self.product, self._groups)
        self.product.take_over(problem)
        self.preconditioner.most_drift = MOST_DRIFT
        self._space.forget()

    def destroy(self) -> None:
        """See TangentOperator."""
        for part in (self._local, self._parts, self._space):
            part.forget()
        self.preconditioner.drop_inverses()
        for item in (self._solver, self._matrix, self._right, self._left):
            item.destroy()
