"""What regions, springs and pairs store at a step, and what weights and far stresses work on (theory, 73, 74).

Notation and formulas: pbem.results.energy.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pbem.arrays import Bool, Complex, Integer, Real
from pbem.bem.particular_solution import ParticularSolution
from pbem.bem.point_field import find_shift
from pbem.contact.arrangement import Arrangement, find_arrangement
from pbem.contact.at_rest import bear_in_situ
from pbem.contact.laws import collect_laws
from pbem.contact.loads import collect_outer_nodes, evaluate_ends, evaluate_pressure, evaluate_walls
from pbem.mesh.mesh import Faces, Mesh, list_faces, second_face_nodes
from pbem.model.model import Model
from pbem.results.dissipation import PairRecord, measure_stored, record_pairs, record_pairs_at_rest
from pbem.results.face_weights import weigh_faces
from pbem.results.point_work import evaluate_unit_motions, measure_point_forces, measure_point_motions
from pbem.solve.problem.particular_solutions import evaluate_particular_solutions
from pbem.solve.problem.step import Step
from pbem.uniform import fold_uniform, is_nothing, repeat_value

UNIT_STRESSES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
# Faces whose work is summed up at a time.
SUMMED = 4096


# Per region, the balanced particular solution and the one far away.
_Particulars = list[tuple[ParticularSolution, ParticularSolution]]
# Tractions without those of the in-situ stress and displacements (f,) on all faces, and forces of point loads (l,).
_Fields = tuple[Complex, Complex, Real]


class _Sides:
    """All faces (f,) of a mesh, by region, some at a time: lists of all that they have take more than twice the room.

    Made anew for each step: all that the writer keeps is held on the first rank beside its share of the matrices.
    """

    def __init__(self, mesh: Mesh) -> None:
        self._mesh = mesh
        self._second = second_face_nodes(mesh)

    @cached_property
    def faces(self) -> Faces:
        """With all that they have."""
        return list_faces(self._mesh)

    @property
    def region(self) -> Integer:
        """Of each face (f,)."""
        return np.concatenate([self._mesh.node_region, self._mesh.node_region[self._second]])

    @cached_property
    def _by_region(self) -> tuple[Integer, Integer]:
        region = self.region
        order = np.argsort(region, kind="stable")
        return order, np.searchsorted(region[order], np.arange(len(self._mesh.region_names) + 1))

    def find(self, region: int) -> Integer:
        """Those (k,) of a region."""
        order, bounds = self._by_region
        return order[bounds[region]:bounds[region + 1]]

    def place(self, at: Integer) -> tuple[Complex, Complex]:
        """Positions and normals (k,) of some faces."""
        behind = at >= self._mesh.nodes
        node = np.where(behind, self._second[np.where(behind, at - self._mesh.nodes, 0)], at) if behind.any() else at
        return self._mesh.position[node], np.where(behind, -1, 1) * self._mesh.normal[node]


@dataclass(frozen=True)
class _Reference:
    """Fields (c,) of unit forces or unit stresses in one region, by its number, about a center, and the
    integral (c,) of the displacement over a finite region. at_points (c, l): what they move the model's point loads by,
    3 numbers each; 0 for those of other regions."""

    region: int
    fields: tuple[ParticularSolution, ...]
    center: complex
    integral: Complex
    at_points: Real

    def conjugate(
        self, sides: _Sides, weight: Real, traction: Complex, displacement: Complex, point_forces: Real
    ) -> Real:
        """Betti's sum (c,) for the field with tractions and displacements on all faces (f,); point_forces (l,).

        The unit fields are evaluated anew, some faces at a time: stored they would be most of what the writer holds.
        """
        on_faces, own = np.zeros(len(self.fields)), sides.find(self.region)
        for begin in range(0, len(own), SUMMED):
            at = own[begin:begin + SUMMED]
            z, n = sides.place(at)
            z = z - self.center
            w, t, u = weight[at], traction[at], displacement[at]
            for k, field in enumerate(self.fields):
                on_faces[k] += (w * (t * np.conj(field.displacement(z)) - np.conj(field.traction(z, n)) * u)).real.sum()
        return np.asarray(on_faces + self.at_points @ point_forces)


@dataclass(frozen=True)
class EnergyState:
    """t, u (f,) on all faces; swollen (f,): of u what swelling does without stress; load and conjugate (c,): weights
    and far stresses of all regions, and what they work on, but for swelling; stored: in the regions; springs: stored in
    springs; pairs; walls (m, 2): tractions that act where the other side is gone."""

    traction: Complex
    displacement: Complex
    swollen: Complex
    load: Real
    conjugate: Real
    stored: float
    springs: float
    pairs: PairRecord
    walls: Real


@dataclass(frozen=True)
class _Work:
    """load (c,) works on conjugate (c,), and so much of it is stored."""

    load: Real
    conjugate: Real
    stored: float


class StoredEnergy:
    """The state of a model by its boundary values, step by step.

    laws: of the pairs. outer: the nodes of outer curves. there: what a stage has taken away, None for nothing.
    weight (f,): of the faces that are there, 0 of others.
    """

    def __init__(self, model: Model, mesh: Mesh) -> None:
        """Begins with all that the model has; `arrange` goes to a stage."""
        self._model, self._mesh = model, mesh
        self.laws = collect_laws(model, mesh)
        self.outer = collect_outer_nodes(model, mesh)
        self._all_weight = self.weight = weigh_faces(mesh)
        self.there: Arrangement | None = None
        sides = _Sides(mesh)
        self._forces = [
            self._refer(
                sides, number, [ParticularSolution(each.material, force=force) for force in (1, 1j)], within=True)
            for number, each in enumerate(model.regions) if each.material.density and not each.infinite
        ]  # fmt: skip
        self._stresses = [
            self._refer(sides, number, [ParticularSolution(each.material, remote=stress) for stress in UNIT_STRESSES])
            for number, each in enumerate(model.regions) if each.infinite
        ]  # fmt: skip
        self._is_tool = np.array([each.rigid for each in model.regions])[sides.region]
        self._in_situ = self._sample_in_situ(sides)
        first = find_arrangement(model, mesh, self.outer, 0)
        self._pairs_at_rest = record_pairs_at_rest(
            self.laws, *bear_in_situ(model, mesh)[:2], opening=None if first is None else first.opening)

    @property
    def pair_weight(self) -> Real:
        pairs = self._mesh.pairs
        whole = np.where(pairs.crack, self.weight[pairs.first], pairs.weight)
        return whole if self.there is None else np.where(self.there.bared, 0.0, whole)

    def add_up(self, state: EnergyState) -> float:
        """All that is stored beyond what was before any load: in the regions, in springs and in elastic joints."""
        joints = measure_stored(self.pair_weight, state.pairs) - measure_stored(self.pair_weight, self._pairs_at_rest)
        return state.stored + state.springs + joints

    @property
    def tools(self) -> Real:
        """The weights of rigid tools alone."""
        return np.where(self._is_tool, self.weight, 0.0)

    @property
    def jointed(self) -> Real:
        """The weights of faces of interfaces, cracks and contacts, without those whose other side is gone."""
        weight = np.array(self._elastic)
        weight[self.outer.node] = 0.0
        if self.there is not None:
            weight[self.there.bare] = 0.0
        return weight

    @property
    def _elastic(self) -> Real:
        """The weights of what is elastic."""
        return np.where(self._is_tool, 0.0, self.weight)

    def arrange(self, stage: int) -> None:
        """From now on sums are those of what is there in a stage."""
        self.there = find_arrangement(self._model, self._mesh, self.outer, stage)
        self.weight = self._all_weight
        if self.there is not None:
            self.weight = np.where(self.there.regions[_Sides(self._mesh).region], 0.0, self._all_weight)

    def describe_rest(self) -> EnergyState:
        nothing = repeat_value(0.0, len(self.weight), complex)
        return self._compose(self._in_situ, nothing, 0, 0.0, self._pairs_at_rest)

    def describe(self, step: Step) -> EnergyState:
        pressure = fold_uniform(evaluate_pressure(self._model, self._mesh, step.stage, step.factor))
        pairs = record_pairs(self.laws, step.contact, pressure)
        return self._compose(step.traction, step.displacement, step.stage, step.factor, pairs)

    def _compose(
        self, traction: Complex, displacement: Complex, stage: int, factor: float, pairs: PairRecord
    ) -> EnergyState:
        """The energy that is stored, and what weights and far stresses work on (theory, 73, 74)."""
        particulars, sides = evaluate_particular_solutions(self._model, stage, factor), _Sides(self._mesh)
        swollen = self._sample_swelling(sides, [balanced for balanced, _ in particulars])
        strained = _subtract(displacement, swollen)  # by stress alone
        point_forces, moved = self._move_points(sides, traction, strained, stage, factor, particulars)
        works = [_Work(point_forces, moved, 0.5 * float(point_forces @ moved))]
        fields = (_subtract(traction, self._in_situ), strained, point_forces)
        works += [self._lift(sides, reference, particulars, fields) for reference in self._forces]
        works += [self._strain(sides, reference, particulars, fields) for reference in self._stresses]
        planes = [number for number, each in enumerate(self._model.regions) if each.infinite]
        works += [self._move_plane(sides, number, fields) for number in planes]
        return EnergyState(
            traction, displacement, swollen,
            load=np.concatenate([each.load for each in works]),
            conjugate=np.concatenate([each.conjugate for each in works]),
            stored=sum((each.stored for each in works), 0.5 * self._sum_elastic(traction, strained)),
            springs=0.5 * self._measure_springs(displacement, stage, factor), pairs=pairs,
            walls=evaluate_walls(self._model, self._mesh, stage, factor),
        )  # fmt: skip

    def _sum_elastic(self, traction: Complex, displacement: Complex) -> float:
        """What tractions and those of the in-situ stress (f,) do on displacements (f,) of what is elastic."""
        total, weight = 0.0, self._elastic
        for begin in range(0, len(weight), SUMMED):
            at = slice(begin, begin + SUMMED)
            total += sum_work(weight[at], traction[at] + self._in_situ[at], displacement[at])
        return total

    def _move_points(
        self, sides: _Sides, traction: Complex, displacement: Complex, stage: int, factor: float,
        particulars: _Particulars,
    ) -> tuple[Real, Real]:
        """Forces of the point loads (l,), 3 numbers each, and what they move by; 0 where their region is gone."""
        if not self._model.point_loads:
            return np.zeros(0), np.zeros(0)
        forces = measure_point_forces(self._model, stage, factor)
        moved = measure_point_motions(
            self._model, self._mesh, sides.faces, self.weight, (displacement, traction), particulars
        )
        acting = np.repeat(self._find_acting_points(), 3)
        return np.where(acting, forces, 0.0), np.where(acting, moved, 0.0)

    def _lift(self, sides: _Sides, reference: _Reference, particulars: _Particulars, fields: _Fields) -> _Work:
        """What the weight of a finite region works on, and stores; nothing where the region is gone."""
        if self.there is not None and self.there.regions[reference.region]:
            return _Work(np.zeros(2), np.zeros(2), 0.0)
        balanced, _ = particulars[reference.region]
        moved = reference.conjugate(sides, self.weight, *fields) + (np.conj(balanced.force) * reference.integral).real
        weight = balanced.force + balanced.carried
        # In-situ stress that carries a weight does the work of both.
        both = weight + balanced.carried
        return _Work(_split(weight), moved, 0.5 * float(_split(both) @ moved))

    def _strain(self, sides: _Sides, reference: _Reference, particulars: _Particulars, fields: _Fields) -> _Work:
        """What the stress far away in an infinite region works on, and stores."""
        balanced, far = particulars[reference.region]
        initial, remote = np.array(balanced.initial.value), np.array(far.remote)
        strained = reference.conjugate(sides, self.weight, *fields)
        return _Work(initial + remote, strained, 0.5 * float((2 * initial + remote) @ strained))

    def _move_plane(self, sides: _Sides, number: int, fields: _Fields) -> _Work:
        """What a net force on an infinite region works on, as its displacement is counted from a distance that does not
        depend on the mesh (theory, 101)."""
        model, region = self._model, self._model.regions[number]
        own, numbered = sides.find(number), enumerate(model.point_loads.values())
        force = complex(self.weight[own] @ fields[0][own])
        force += sum(complex(*fields[2][3 * k : 3 * k + 2]) for k, load in numbered if load.region == region.name)
        lengths = model.self_energy_lengths[region.name], model.logarithm_lengths[region.name]
        moved = -find_shift(force, *lengths, region.material)
        return _Work(_split(force), _split(moved), 0.5 * (np.conj(force) * moved).real)

    def _find_acting_points(self) -> Bool:
        """Which point loads (c,) act on regions that are there."""
        gone = {name for name, is_gone in zip(self._mesh.region_names, self.there.regions, strict=True) if is_gone} \
            if self.there is not None else set()
        return np.array([load.region not in gone for load in self._model.point_loads.values()])

    def _measure_springs(self, displacement: Complex, stage: int, factor: float) -> float:
        outer = self.outer
        along = (np.conj(outer.direction) * displacement[outer.node][:, None]).real
        if self._model.stages[stage].ends:
            along -= evaluate_ends(self._model, outer, stage, factor)
        return float(self.weight[outer.node] @ (outer.stiffness * along**2).sum(axis=1))

    def _sample_in_situ(self, sides: _Sides) -> Complex:
        """Traction of the in-situ stress on all faces (f,)."""
        traction = repeat_value(0.0, len(self.weight), complex)
        for number, (balanced, _) in enumerate(evaluate_particular_solutions(self._model, 0, 0.0)):
            at_rest = ParticularSolution(balanced.material, initial=balanced.initial)
            if at_rest.is_zero:
                continue
            own, traction = sides.find(number), np.require(traction, requirements="W")
            traction[own] = at_rest.traction(*sides.place(own))
        return traction

    def _sample_swelling(self, sides: _Sides, particulars: Sequence[ParticularSolution]) -> Complex:
        """Displacement of the strain without stress on all faces (f,), each region turned and moved back to where it
        was in the mean: what forces are out of balance would work on the way to it from the corner of the model."""
        moved = repeat_value(0.0, len(self.weight), complex)
        for number, balanced in enumerate(particulars):
            if not balanced.swelling.is_zero:
                own, moved = sides.find(number), np.require(moved, requirements="W")
                place, weight = sides.place(own)[0], self._all_weight[own]
                moved[own] = _take_back(place, balanced.swelling.displacement(place), weight)
        return moved

    def _refer(
        self, sides: _Sides, region: int, fields: Sequence[ParticularSolution], within: bool = False
    ) -> _Reference:
        """Fields about the origin, or about a point `within` a finite region, where rounding is smallest."""
        faces = sides.find(region)
        z, n = sides.place(faces)
        center = complex(z.mean()) if within else 0j
        z = z - center
        loads = list(self._model.point_loads.values())
        motions = evaluate_unit_motions(list(fields), center, loads, self._model.size).reshape(len(fields), -1)
        motions *= np.repeat([load.region == self._model.regions[region].name for load in loads], 3)
        # The displacements of unit forces are multiples of z^2, whose integral is half that of n z^2 conj(z).
        second_moment = 0.5 * (self.weight[faces] * n * z**2 * np.conj(z)).sum()
        return _Reference(
            region, tuple(fields), center,
            np.array([complex(field.displacement(np.array([1 + 0j]))[0]) * second_moment for field in fields]),
            motions,
        )


def sum_work(weight: Real, traction: Complex, displacement: Complex) -> float:
    """Tractions (f,) times displacements (f,), integrated by weights (f,)."""
    total = 0.0
    for begin in range(0, len(weight), SUMMED):
        at = slice(begin, begin + SUMMED)
        total += float(weight[at] @ (traction[at] * np.conj(displacement[at])).real)
    return total


def _subtract(values: Complex, part: Complex) -> Complex:
    """The values without a part of them, in the same place where that is nothing."""
    return values if is_nothing(part) else values - part


def _split(force: complex) -> Real:
    return np.array([force.real, force.imag])


def _take_back(place: Complex, moved: Complex, weight: Real) -> Complex:
    """The displacements without the translation and the rotation that they have in the mean over weights."""
    away = place - np.average(place, weights=weight)
    moved = moved - np.average(moved, weights=weight)
    turn = float(weight @ (np.conj(away) * moved).imag) / float(weight @ np.abs(away) ** 2)
    return np.asarray(moved - 1j * turn * away)
