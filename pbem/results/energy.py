"""The energy balance: work of loads and conditions, stored elastic energy, dissipation; all by sums over the boundary.

Notation: t, u traction and displacement on the faces, outward normals; t0 the traction of the in-situ stress s0; b the
weight per volume; (t, u)_f a field of unit body force f, (t, u)_j one of unit uniform stress j. The energy stored in a
region since before any load is the integral of (s0 + s)/2 : strain, by the divergence theorem

    W = 1/2 sum (t + t0) . u + 1/2 b . I,
    I_f = integral of f . u = sum [(t - t0) . u_f - t_f . u] + integral of b . u_f

where I is Betti's theorem for the field and that of the unit force. In an infinite region W is the excess over the same
plane without holes and cracks, with dead tractions far away, and the far stress has the work-conjugate S:

    W = 1/2 sum (t + t0) . u + 1/2 (2 s0 + far) . S,    S_j = sum [(t - t0) . u_j - t_j . u]

again Betti's theorem, between the boundary and a large circle. The work in a step is (old + new)/2 times an increment:
t times that of u on outer curves, b times that of I, s0 + far times that of S. Together they are the increment of W and
the same sum over the pairs, tractions times jumps, as exactly as the discrete fields obey Betti's theorem from step to
step; in one step from rest, exactly.

Where faces lose strength as they slip or part, there may be no equilibria from the beginning of a step to its end: they
run away. Loads that grow steadily do between t du and (t + dt) du: the trapezoid is off by half of dt du at most. What
the tractions of the pairs do in excess of their laws' integrals can be an error of the trapezoid up to there; where it
is more it was set free, under loads that hardly change, and the trapezoid on the boundary holds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pbem.arrays import Bool, Complex, Integer, Real
from pbem.bem.particular_solution import ParticularSolution
from pbem.contact.arrangement import Arrangement, find_arrangement
from pbem.contact.laws import collect_laws
from pbem.contact.loads import collect_outer_nodes, evaluate_ends, evaluate_load
from pbem.mesh.mesh import Mesh, list_faces
from pbem.model.model import Model
from pbem.results.dissipation import (
    PairRecord,
    PairWork,
    measure_stored,
    measure_work,
    record_pairs,
    record_pairs_at_rest,
)
from pbem.results.face_weights import weigh_faces
from pbem.results.point_work import evaluate_unit_motions, measure_point_forces, measure_point_motions
from pbem.results.runaway import Runaway
from pbem.solve.problem.particular_solutions import evaluate_particular_solutions
from pbem.solve.problem.step import Step

UNIT_STRESSES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
# A step within which faces ran away released at least this part of the energy that was stored.
LEAST_RELEASED = 0.01
# Interfaces that took part in it have at least this part of what was released.
LEAST_PART = 0.01


@dataclass(frozen=True)
class Energy:
    """Per unit of thickness (stress times length squared), since before any load.

    external: work of prescribed tractions and displacements, fluid pressure, weight, stress far away, point loads, and
    swelling. The energy of point loads is that without the infinite one of each load alone (pbem.results.point_work).
    elastic: stored in the regions, in springs under outer curves and in the elastic joints of interfaces.
    dissipated: by friction and by bonds that parted; it never falls.
    released: set free where faces ran away within a step, as motion that the quasi-static balance does not follow.
    removed: taken out where a stage opens faces or takes regions away: what these had stored, and the work against the
    tractions that are released.
    external = elastic + dissipated + released + removed, as exactly as the discrete fields obey Betti's theorem.
    """

    external: float
    elastic: float
    dissipated: float
    released: float = 0.0
    removed: float = 0.0


@dataclass(frozen=True)
class _Reference:
    """Fields of unit forces or unit stresses in one region: its faces (k,), their traction and displacement (c, k),
    and the integral (c,) of the displacement over a finite region. at_points (c, l): what they move the model's point
    loads by, 3 numbers each; 0 for those of other regions."""

    faces: Integer
    traction: Complex
    displacement: Complex
    integral: Complex
    at_points: Real

    def conjugate(self, weight: Real, traction: Complex, displacement: Complex, point_forces: Real) -> Real:
        """Betti's sum (c,) for the field with tractions and displacements on all faces (f,); point_forces (l,)."""
        w, t, u = weight[self.faces], traction[self.faces], displacement[self.faces]
        on_faces = (w * (t * np.conj(self.displacement) - np.conj(self.traction) * u)).real.sum(axis=1)
        return np.asarray(on_faces + self.at_points @ point_forces)


@dataclass(frozen=True)
class _State:
    """t, u (f,) on all faces; swollen (f,): of u what swelling does without stress; load and conjugate (c,): weights
    and far stresses of all regions, and what they work on, but for swelling; stored: in the regions; springs: stored in
    springs; pairs."""

    traction: Complex
    displacement: Complex
    swollen: Complex
    load: Real
    conjugate: Real
    stored: float
    springs: float
    pairs: PairRecord


class EnergyBalance:
    """Adds up the energies step by step: all steps of a run in turn, also those that are not stored.

    laws: those of the pairs, evaluated once more here.
    """

    def __init__(self, model: Model, mesh: Mesh, last: Step | None = None, reached: Energy | None = None) -> None:
        """Begins at rest, or after the step `last` with the energies that were reached by then."""
        self._model, self._mesh = model, mesh
        self.laws = collect_laws(model, mesh)
        self._outer = collect_outer_nodes(model, mesh)
        self._weight = weigh_faces(mesh)
        self._faces = list_faces(mesh)
        self._by_region = np.argsort(self._faces.region, kind="stable")
        self._bounds = np.searchsorted(self._faces.region[self._by_region], np.arange(len(model.regions) + 1))
        self._forces = [
            self._refer(number, [ParticularSolution(each.material, force=force) for force in (1, 1j)], within=True)
            for number, each in enumerate(model.regions) if each.material.density and not each.infinite
        ]  # fmt: skip
        self._stresses = [
            self._refer(number, [ParticularSolution(each.material, remote=stress) for stress in UNIT_STRESSES])
            for number, each in enumerate(model.regions) if each.infinite
        ]  # fmt: skip
        self._is_tool = np.array([each.rigid for each in model.regions])[self._faces.region]
        self._in_situ = self._sample_in_situ()
        self._reached = reached or Energy(0.0, 0.0, 0.0)
        self.runaway: Runaway | None = None
        self._last = last
        self._there: Arrangement | None = None
        self._all_weight = self._weight
        if last is not None:
            self._arrange(last.stage)
        self._state = self._describe_rest() if last is None else self._describe(last)

    def add(self, step: Step) -> Energy:
        """The energies after the next step; `runaway` tells whether faces ran away in it (theory, 75)."""
        old, before, lost = self._state, self._reached, 0.0
        if step.stage != (0 if self._last is None else self._last.stage) or self._last is None:
            held, before_it = self._add_stored(old), self._there
            self._arrange(step.stage)
            if before_it is not None or self._there is not None:
                old = self._describe_rest() if self._last is None else self._describe(self._last)
                lost = held - self._add_stored(old)  # with the regions that are taken away
        new, self._last = self._describe(step), step
        nodes = self._outer.node
        moved = (new.displacement - old.displacement)[nodes]
        work = _dot(self._weight[nodes], 0.5 * (old.traction + new.traction)[nodes], moved)
        work -= _dot(self._tools, 0.5 * (old.traction + new.traction), new.displacement - old.displacement)
        work += float(0.5 * (old.load + new.load) @ (new.conjugate - old.conjugate))
        # What swells does work against the stress.
        work -= _dot(self._weight, 0.5 * (old.traction + new.traction), new.swollen - old.swollen)
        opened = None if self._there is None else self._there.opened
        pairs = measure_work(self.laws, self._pair_weight, old.pairs, new.pairs, opened)
        fluid, bared = self._measure_bared(old, new)
        # What springs take from the boundary they store, and what fluid does is work of its own.
        work += new.springs - old.springs + pairs.fluid + fluid
        self._state = new
        self.runaway = self._find_runaway(old, new, moved, pairs, abs(before.elastic) + abs(work))
        dissipated, released = pairs.dissipated, 0.0
        if self.runaway is not None:
            dissipated, released = pairs.friction, self.runaway.released
        else:
            # Where a pair changed within the step, the trapezoid on the boundary is off by as much as on the pair.
            work -= pairs.excess
        self._reached = Energy(
            external=before.external + work,
            elastic=self._add_stored(new),
            dissipated=before.dissipated + dissipated,
            released=before.released + released,
            removed=before.removed + lost + pairs.taken + bared,
        )
        if self._model.grows_without_end:  # so would the energy
            return replace(self._reached, external=np.nan, elastic=np.nan)
        return self._reached

    def _find_runaway(
        self, old: _State, new: _State, moved: Complex, pairs: PairWork, at_hand: float
    ) -> Runaway | None:
        """What was set free in the step, if growing loads do not explain it; at_hand: energy stored and supplied."""
        released = float(pairs.surplus.sum())
        if not released > max(LEAST_RELEASED * at_hand, self._measure_increments(old, new, moved)):
            return None
        names = self._mesh.interface_names
        by_name = np.bincount(self._mesh.pairs.interface, pairs.surplus, minlength=len(names))
        largest = np.argsort(-by_name, kind="stable")
        part = tuple(names[number] for number in largest if by_name[number] > LEAST_PART * released)
        return Runaway(released, released / at_hand, part)

    def _measure_increments(self, old: _State, new: _State, moved: Complex) -> float:
        """Half of what the increments of all loads and reactions do in the step, each by its size."""
        outer, weight = self._outer, self._weight[self._outer.node]
        traction, away = (new.traction - old.traction)[outer.node, None], moved[:, None]
        along, by = ((np.conj(outer.direction) * values).real for values in (traction, away))
        # Springs follow the displacement, of which the trapezoid is exact.
        total = float(weight @ np.abs((along + outer.stiffness * by) * by).sum(axis=1))
        total += float(np.abs((new.load - old.load) * (new.conjugate - old.conjugate)).sum())
        pressure, opened = new.pairs.pressure - old.pairs.pressure, new.pairs.g_n - old.pairs.g_n
        total += float(self._pair_weight @ np.abs(pressure * opened))
        # Tools push where they touch; what swells works against the stress; what a stage releases is a load as well.
        change, moved = new.traction - old.traction, new.displacement - old.displacement
        total += _add_sizes(self._tools, change, moved) + _add_sizes(self._weight, change, new.swollen - old.swollen)
        if self._there is not None:
            at = self._there.bare
            total += _add_sizes(self._weight[at], change[at], moved[at])
            fallen, slid = new.pairs.p_n - old.pairs.p_n, new.pairs.g_s - old.pairs.g_s
            work = np.abs(fallen * opened) + np.abs((new.pairs.p_s - old.pairs.p_s) * slid)
            total += float(self._pair_weight @ np.where(self._there.opening, work, 0.0))
        return 0.5 * total

    @property
    def _pair_weight(self) -> Real:
        pairs = self._mesh.pairs
        whole = np.where(pairs.crack, self._weight[pairs.first], pairs.weight)
        return whole if self._there is None else np.where(self._there.bared, 0.0, whole)

    def _add_stored(self, state: _State) -> float:
        """All that is stored: in the regions, in springs and in elastic joints."""
        return state.stored + state.springs + measure_stored(self._pair_weight, state.pairs)

    @property
    def _tools(self) -> Real:
        """The weights of rigid tools alone."""
        return np.where(self._is_tool, self._weight, 0.0)

    @property
    def _elastic(self) -> Real:
        """The weights of what is elastic."""
        return np.where(self._is_tool, 0.0, self._weight)

    def _arrange(self, stage: int) -> None:
        """From now on sums are those of what is there in a stage."""
        self._there = find_arrangement(self._model, self._mesh, self._outer, stage)
        self._weight = self._all_weight
        if self._there is not None:
            self._weight = np.where(self._there.regions[self._faces.region], 0.0, self._all_weight)

    def _measure_bared(self, old: _State, new: _State) -> tuple[float, float]:
        """On faces whose other side is gone: work of the fluid, and what the tractions take that are released.

        (theory, 97)
        """
        there, mesh = self._there, self._mesh
        if there is None or not there.bared.any():
            return 0.0, 0.0
        pairs, links, count = mesh.pairs, mesh.links, mesh.nodes
        pressure = np.where(there.bared, 0.5 * (old.pairs.pressure + new.pairs.pressure), 0.0)
        pressed = np.zeros(count, dtype=complex)
        pressed[pairs.slave] = pairs.sense * pressure * pairs.normal
        given = links.traction_weight * pressed[pairs.slave[links.traction_pair]]
        np.subtract.at(pressed, links.traction_node, given)
        at = there.bare
        moved = (new.displacement - old.displacement)[at]
        fluid = _dot(self._weight[at], pressed[at], moved)
        return fluid, fluid - _dot(self._weight[at], 0.5 * (old.traction + new.traction)[at], moved)

    def _describe_rest(self) -> _State:
        nothing = np.zeros(len(self._weight), dtype=complex)
        pairs = record_pairs_at_rest(self.laws, self._mesh, self._in_situ[: self._mesh.nodes])
        return self._compose(self._in_situ, nothing, 0, 0.0, pairs)

    def _describe(self, step: Step) -> _State:
        pressure = evaluate_load(self._model, self._mesh, self._outer, step.stage, step.factor).pressure
        pairs = record_pairs(self.laws, step.contact, pressure)
        return self._compose(step.traction, step.displacement, step.stage, step.factor, pairs)

    def _compose(
        self, traction: Complex, displacement: Complex, stage: int, factor: float, pairs: PairRecord
    ) -> _State:
        """The energy that is stored, and what weights and far stresses work on (theory, 73, 74)."""
        particulars = evaluate_particular_solutions(self._model, stage, factor)
        elastic = traction - self._in_situ
        loads, conjugates = [np.zeros(0)], [np.zeros(0)]
        swollen = self._sample_swelling([balanced for balanced, _ in particulars])
        displacement = displacement - swollen
        point_forces = np.zeros(0)
        if self._model.point_loads:
            point_forces = measure_point_forces(self._model, stage, factor)
            moved = measure_point_motions(
                self._model, self._mesh, self._faces, self._weight, (displacement, traction), particulars
            )
            acting = np.repeat(self._find_acting_points(), 3)
            point_forces, moved = np.where(acting, point_forces, 0.0), np.where(acting, moved, 0.0)
            loads.append(point_forces)
            conjugates.append(moved)
        stored = 0.5 * _dot(self._elastic, traction + self._in_situ, displacement)
        if self._model.point_loads:
            stored += 0.5 * float(point_forces @ moved)
        for reference in self._forces:
            if self._there is not None and self._there.regions[self._faces.region[reference.faces[0]]]:
                loads.append(np.zeros(2))
                conjugates.append(np.zeros(2))
                continue
            balanced, _ = particulars[self._faces.region[reference.faces[0]]]
            moved = reference.conjugate(self._weight, elastic, displacement, point_forces)
            moved += (np.conj(balanced.force) * reference.integral).real
            weight = balanced.force + balanced.carried
            loads.append(np.array([weight.real, weight.imag]))
            conjugates.append(moved)
            # In-situ stress that carries a weight does the work of both.
            both = weight + balanced.carried
            stored += 0.5 * float(np.array([both.real, both.imag]) @ moved)
        for reference in self._stresses:
            balanced, far = particulars[self._faces.region[reference.faces[0]]]
            initial, remote = np.array(balanced.initial.value), np.array(far.remote)
            strained = reference.conjugate(self._weight, elastic, displacement, point_forces)
            loads.append(initial + remote)
            conjugates.append(strained)
            stored += 0.5 * float((2 * initial + remote) @ strained)
        springs = 0.5 * self._measure_springs(displacement + swollen, stage, factor)
        return _State(
            traction, displacement + swollen, swollen, np.concatenate(loads), np.concatenate(conjugates), stored,
            springs, pairs,
        )

    def _find_acting_points(self) -> Bool:
        """Which point loads (c,) act on regions that are there."""
        gone = {name for name, is_gone in zip(self._mesh.region_names, self._there.regions, strict=True) if is_gone} \
            if self._there is not None else set()
        return np.array([load.region not in gone for load in self._model.point_loads.values()])

    def _measure_springs(self, displacement: Complex, stage: int, factor: float) -> float:
        outer = self._outer
        along = (np.conj(outer.direction) * displacement[outer.node][:, None]).real
        if self._model.stages[stage].ends:
            along -= evaluate_ends(self._model, outer, stage, factor)
        return float(self._weight[outer.node] @ (outer.stiffness * along**2).sum(axis=1))

    def _sample_in_situ(self) -> Complex:
        """Traction of the in-situ stress on all faces (f,)."""
        traction = np.zeros(len(self._weight), dtype=complex)
        for number, (balanced, _) in enumerate(evaluate_particular_solutions(self._model, 0, 0.0)):
            at_rest = ParticularSolution(balanced.material, initial=balanced.initial)
            if at_rest.is_zero:
                continue
            own = self._find_faces(number)
            traction[own] = at_rest.traction(self._faces.position[own], self._faces.normal[own])
        return traction

    def _sample_swelling(self, particulars: Sequence[ParticularSolution]) -> Complex:
        """Displacement of the strain without stress on all faces (f,)."""
        moved = np.zeros(len(self._weight), dtype=complex)
        for number, balanced in enumerate(particulars):
            if not balanced.swelling.is_zero:
                own = self._find_faces(number)
                moved[own] = balanced.swelling.displacement(self._faces.position[own])
        return moved

    def _find_faces(self, region: int) -> Integer:
        return self._by_region[self._bounds[region]:self._bounds[region + 1]]

    def _refer(self, region: int, fields: Sequence[ParticularSolution], within: bool = False) -> _Reference:
        """Fields about the origin, or about a point `within` a finite region, where rounding is smallest."""
        faces = self._find_faces(region)
        z, n = self._faces.position[faces], self._faces.normal[faces]
        center = complex(z.mean()) if within else 0j
        z = z - center
        loads = list(self._model.point_loads.values())
        motions = evaluate_unit_motions(list(fields), center, loads, self._model.size).reshape(len(fields), -1)
        motions *= np.repeat([load.region == self._model.regions[region].name for load in loads], 3)
        # The displacements of unit forces are multiples of z^2, whose integral is half that of n z^2 conj(z).
        second_moment = 0.5 * (self._weight[faces] * n * z**2 * np.conj(z)).sum()
        return _Reference(
            faces,
            np.array([field.traction(z, n) for field in fields]),
            np.array([field.displacement(z) for field in fields]),
            np.array([complex(field.displacement(np.array([1 + 0j]))[0]) * second_moment for field in fields]),
            motions,
        )


def _dot(weight: Real, traction: Complex, displacement: Complex) -> float:
    return float(weight @ (traction * np.conj(displacement)).real)


def _add_sizes(weight: Real, traction: Complex, displacement: Complex) -> float:
    return float(weight @ np.abs((traction * np.conj(displacement)).real))
