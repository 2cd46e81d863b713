"""Stress-intensity factors, J-integral and T-stress at the tips of cracks, from the jumps of displacement near them."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbem.arrays import Bool, Complex, Integer, Real
from pbem.bem.particular_solution import ParticularSolution
from pbem.contact.laws import OPEN, collect_laws
from pbem.geometry.elements import Elements
from pbem.mesh.interpolation import split_faces
from pbem.mesh.mesh import Mesh, sort_pairs
from pbem.mesh.shape_functions import interpolate_shapes
from pbem.model.material import Material
from pbem.model.model import Model
from pbem.results.interface_release import InterfaceRelease, prepare_interface_release
from pbem.results.interface_tips import list_tip_curves
from pbem.results.tip_field import TipShape
from pbem.results.tip_path import TipPaths, trace_paths, view_outward
from pbem.results.tip_shape import STRAIGHT, Derived, TipForms
from pbem.solve.problem.particular_solutions import evaluate_particular_solutions
from pbem.solve.problem.step import ContactState, Step

# A straight crack of more elements is not taken as a whole.
MOST_WHOLE = 100
# The pressure on open faces jumps between two elements where it differs by more than this part of the largest.
UNEVEN = 0.1
# Cracks whose elements are the same to this part of their lengths share their forms.
ALIKE = 1e-9
# Of K, by the order, where few elements lie between the tip and what meets the crack: two solutions see the field there
# alike.
SHORT_ERROR = (0.1, 0.02, 5e-3, 2e-3)
# Laws of faces whose tractions follow the jump; those of others do with elastic joints, or weakening by slip.
MOVING = ("cohesive", "barton_bandis", "custom")


@dataclass(frozen=True)
class _Alike:
    """Tips (k,) with the same elements around them, turned and enlarged, in the same material.

    tip: number among the ends of all cracks; place (k,): where. direction (k,): unit vector that the tip points along;
    length (k,): their unit. pair, sense (k, m (p + 1)): pairs of the nodes, from the tip on, and 1 or -1 where the
    first face is on the left or on the right when leaving the tip. region (k,): index.
    """

    forms: TipForms
    material: Material
    tip: Integer
    region: Integer
    place: Complex
    direction: Complex
    length: Real
    pair: NDArray[np.int32]
    sense: NDArray[np.int8]


@dataclass(frozen=True)
class TipRules:
    """How the values at the tips follow from the pairs and from the displacement of the faces.

    cracks: their names, then those of interfaces that end as a crack does. is_tip (2 cracks,): of the start and the end
    of the first crack, of the second, ...; False on interfaces. gap (m,): the initial gap of all pairs.
    """

    cracks: tuple[str, ...]
    is_tip: Bool
    gap: Real
    model: Model
    mesh: Mesh
    groups: tuple[_Alike, ...]
    interfaces: InterfaceRelease

    def derive(self, part: slice = slice(None)) -> dict[int, Derived]:
        """Derive the forms of some of the groups now, which else are derived when they are first asked for; by number.
        """
        return {number: self.groups[number].forms.derive() for number in range(len(self.groups))[part]}

    def take(self, derived: Mapping[int, Derived]) -> None:
        """Take the forms of groups that were derived elsewhere, for the same model and mesh."""
        for number, forms in derived.items():
            self.groups[number].forms.take(forms)

    def bound_short(self, KI: Real, KII: Real) -> Real:
        """The least errors of K (cracks, 2), by K as of `evaluate_factors`, or of the first cracks: not zero where few
        elements lie between a tip and what meets the crack."""
        short = np.zeros(len(self.is_tip), dtype=bool)
        for group in self.groups:
            short[group.tip] = group.forms.is_short
        largest = np.fmax(np.abs(KI), np.abs(KII))
        short = short[: largest.size]
        return np.where(short.reshape(-1, 2), SHORT_ERROR[self.mesh.order] * largest, 0.0)

    def evaluate(self, contact: ContactState) -> dict[str, tuple[Real, Real]]:
        """KI and KII (2,) of every crack at its start and its end, as in `evaluate_factors`."""
        return dict(zip(self.cracks, zip(*self.evaluate_factors(contact), strict=True), strict=True))

    def evaluate_all(self, step: Step) -> dict[str, Real]:
        """KI, KII, J and T (cracks, 2) at start and end; of cracks along interfaces J alone."""
        KI, KII = self.evaluate_factors(step.contact)
        J = self.evaluate_release(step.contact)
        for tip, released in zip(self.interfaces.tips, self.interfaces.evaluate(step), strict=True):
            J[self.cracks.index(tip.name), tip.end] = released
        return {"KI": KI, "KII": KII, "J": J, "T": self.evaluate_parallel(step)}

    def evaluate_factors(self, contact: ContactState) -> tuple[Real, Real]:
        """KI and KII (cracks, 2) at start and end, stress times sqrt(length); NaN where no tip is.

        KI > 0 opens; KII > 0 if the face on the left of the crack's direction moves along it, at both ends. Where no
        pair of the tip's element is open or has an elastic joint, KI is exactly zero.
        """
        KI, KII = self._start(), self._start()
        per_element, normal = self.mesh.order + 1, np.asarray(self.mesh.pairs.normal)
        for group in self.groups:
            modulus = group.material.plane_modulus
            jumps = self._jumps(contact, group, normal)[:, : group.forms.intensity.shape[1]]
            factors = (modulus / np.sqrt(group.length))[:, None] * (jumps @ group.forms.intensity.T)
            first = group.pair[:, :per_element]
            opens = (contact.opening[first] != self.gap[first]).any(axis=1)
            slides = (contact.slip[first] != 0).any(axis=1)
            KI[group.tip] = np.where(opens, factors[:, 0], 0.0)
            KII[group.tip] = np.where(slides, factors[:, 1], 0.0)
        return KI.reshape(-1, 2) + 0.0, KII.reshape(-1, 2) + 0.0  # no negative zeros

    def evaluate_release(self, contact: ContactState) -> Real:
        """J (cracks, 2), stress times length: the energy released per length of growth straight ahead; NaN on
        interfaces, whose J needs all of the boundary."""
        J, normal = self._start(), np.asarray(self.mesh.pairs.normal)
        for group in self.groups:
            jumps = self._jumps(contact, group, normal)[:, : len(group.forms.release)]
            form = ((jumps @ group.forms.release) * jumps).sum(axis=1)
            J[group.tip] = group.material.plane_modulus / group.length * form
        return J.reshape(-1, 2) + 0.0

    def evaluate_parallel(self, step: Step) -> Real:
        """T (cracks, 2), stress: what stays finite at the tip of the normal stress along the crack, loads included."""
        T, normal = self._start(), np.asarray(self.mesh.pairs.normal)
        first, opposite = split_faces(self.mesh, step.displacement)
        mean = 0.5 * (first + opposite)[self.mesh.pairs.first]
        particulars = evaluate_particular_solutions(self.model, step.stage, step.factor)
        for group in self.groups:
            forms, material = group.forms, group.material
            modulus = material.plane_modulus
            jumps = self._jumps(step.contact, group, normal)[:, : len(forms.parallel)]
            near = group.pair[:, : len(forms.of_normal)]
            moved = mean[near] * np.conj(group.direction)[:, None]
            # A motion as a whole has no part in it.
            moved = moved - moved.mean(axis=1)[:, None]
            value, even = np.zeros(len(near)), self._count_even(step.contact, near)
            for count in np.unique(even).tolist():
                own = even == count
                parallel, of_mean, of_normal = forms.limit_parallel(count)
                value[own] = modulus / group.length[own] * (jumps[own] @ parallel + (moved[own] @ of_mean).real)
                value[own] += step.contact.traction_n[near[own]] @ of_normal
            value -= modulus * np.array([
                particulars[region][0].swelling.strain_along(at[None], along[None])[0]
                for region, at, along in zip(group.region, group.place, group.direction, strict=True)
            ])
            T[group.tip] = value + self._evaluate_initial(group, [balanced for balanced, _ in particulars])
        return T.reshape(-1, 2)

    def _count_even(self, contact: ContactState, near: NDArray[np.int32]) -> Integer:
        """On how many elements (k,) from tips on, with the pairs near (k, m (p + 1)), the pressure on open faces does
        not jump: the stress along the crack jumps with it. Of constant elements, which always jump, all."""
        per_element = self.mesh.order + 1
        if per_element == 1:
            return np.full(len(near), near.shape[1])
        pressure = contact.traction_n[near].reshape(len(near), -1, per_element)
        is_open = (contact.mode[near] == OPEN).reshape(pressure.shape).all(axis=2)
        at_ends = np.array([[-1.0], [1.0]]) ** np.arange(per_element) @ interpolate_shapes(self.mesh.crack_local)
        step = np.abs(pressure[:, :-1] @ at_ends[1] - pressure[:, 1:] @ at_ends[0])
        largest = np.abs(pressure).max(axis=(1, 2))
        jumps = (step > UNEVEN * largest[:, None]) & is_open[:, :-1] & is_open[:, 1:]
        return np.asarray(np.argmax(np.column_stack([jumps, np.ones(len(near), dtype=bool)]), axis=1) + 1)

    def _start(self) -> Real:
        return np.where(self.is_tip, 0.0, np.nan)

    def _jumps(self, contact: ContactState, group: _Alike, normal: Complex) -> Real:
        """Jumps (k, 2 m (p + 1)) as TipForms takes them, but for the length; normal: of all pairs, which whoever goes
        through the groups, of a few tips each, forms once."""
        # Of the group's pairs alone: all of the model's once for each group would be the most of a step of a network.
        opening, slip = contact.opening[group.pair] - self.gap[group.pair], contact.slip[group.pair]
        jump = -(opening + 1j * slip) * normal[group.pair]
        turned = jump * group.sense * np.conj(group.direction)[:, None]
        return np.stack([turned.real, turned.imag], axis=2).reshape(len(turned), -1)

    def _evaluate_initial(self, group: _Alike, particulars: list[ParticularSolution]) -> Real:
        """In-situ stress, which has no displacement: what Hooke's law leaves out of the stress along the crack."""
        kappa = group.material.kappa
        initial = [particulars[region].initial.evaluate(place[None])[0]
                   for region, place in zip(group.region, group.place, strict=True)]
        sxx, syy, sxy = np.array(initial).T
        turned = 0.5 * (sxx - syy) - 1j * sxy  # (s_tt - s_nn)/2 along a direction d: its product with d^2
        deviator = (turned * group.direction**2).real
        mean, lateral = 0.5 * (sxx + syy), (3 - kappa) / (1 + kappa)
        return np.asarray(mean + deviator - lateral * (mean - deviator))


def collect_tip_rules(model: Model, mesh: Mesh) -> TipRules:
    """How the values at the tips follow from the jumps; the forms are derived once for all cracks that look alike."""
    cracks = list_tip_curves(model, mesh)
    interfaces = prepare_interface_release(model, mesh)
    is_tip = np.array([model.crack_tips.get(name, (False, False)) for name in cracks], dtype=bool).ravel()
    number = np.flatnonzero(is_tip)
    sorted_pairs = sort_pairs(mesh)
    own = [sorted_pairs[cracks[tip // 2]][-1 if tip % 2 else 0] for tip in number]
    element = mesh.pairs.first[np.array(own, dtype=np.int64)] // (mesh.order + 1)
    gap = collect_laws(model, mesh).gap
    if not len(number):
        return TipRules(cracks, is_tip, gap, model, mesh, (), interfaces)
    pair_of = np.full(mesh.nodes, -1)
    pair_of[mesh.pairs.first[mesh.pairs.crack]] = np.flatnonzero(mesh.pairs.crack)
    groups: list[_Alike] = []
    loads = np.array([load.place for load in model.point_loads.values()], dtype=complex)
    soft = _list_soft(model, mesh)
    for paths in trace_paths(mesh, element, number % 2, MOST_WHOLE, loads):
        groups += _gather_alike(model, mesh, paths, number, pair_of, soft)
    return TipRules(cracks, is_tip, gap, model, mesh, tuple(groups), interfaces)


def _gather_alike(
    model: Model, mesh: Mesh, paths: TipPaths, number: Integer, pair_of: Integer, soft_interfaces: Bool
) -> list[_Alike]:
    """Sort paths by what they look like; soft_interfaces: of `_list_soft`."""
    seen, place_of, direction, length = _see_from_tip(mesh, paths)
    region = mesh.region[paths.elements[:, 0]]
    tip = np.where(paths.outward, mesh.tip[paths.elements], np.array([0, 2, 1])[mesh.tip[paths.elements]])
    chord = seen.end - seen.start
    # The nodes of an element belong to one curve.
    soft = soft_interfaces[mesh.pairs.interface[pair_of[paths.elements[:, 0] * (mesh.order + 1)]]]
    columns = np.column_stack([
        np.round(chord[:, 1:] / chord[:, :-1] / ALIKE), np.round(seen.turns / ALIKE), np.round(paths.cut_at / ALIKE),
        paths.cut, paths.near, paths.whole, tip, soft,
    ]) + 0.0  # fmt: skip
    alike: dict[tuple[Material, bytes], list[int]] = {}
    for place, row in enumerate(np.ascontiguousarray(columns, dtype=complex)):
        alike.setdefault((model.regions[int(region[place])].material, row.tobytes()), []).append(place)
    groups = []
    for (material, _), places in alike.items():
        at, first = np.array(places), places[0]
        # Copies: views would keep the elements of all tips, and forms are kept through the run.
        shape = TipShape(
            deepcopy(seen.select(first)), tip[first].copy(),
            mesh.crack_local, material.kappa, bool(paths.whole[first]), int(paths.near[first]), int(paths.cut[first]),
            float(paths.cut_at[first]), bool(soft[first]),
        )  # fmt: skip
        pair = pair_of[_list_outward(mesh, paths.elements[at], paths.outward[at])].astype(np.int32)
        sense = np.repeat(np.where(paths.outward[at], 1, -1).astype(np.int8), mesh.order + 1, axis=1)
        groups.append(_Alike(TipForms(shape), material, number[paths.tip[at]], region[at], place_of[at],
                             direction[at], length[at], pair, sense))
    return groups


def _list_soft(model: Model, mesh: Mesh) -> Bool:
    """Of every interface, whether what its faces carry where they hold or slide depends on how far they have moved."""
    laws = (model.interfaces[name].law if name in model.interfaces else None for name in mesh.interface_names)
    return np.array([law is not None and bool(
        law.normal_stiffness or law.tangential_stiffness or law.slip_distance or law.kind in MOVING
    ) for law in laws], dtype=bool)


def _see_from_tip(mesh: Mesh, paths: TipPaths) -> tuple[Elements, Complex, Complex, Real]:
    """The elements (k, m) of paths in the tips' frames; the places and directions (k,) of the tips, and their units of
    length."""
    elements = view_outward(mesh, paths.elements, paths.outward)
    tip = elements.start[:, :1]
    length = np.abs(elements.end[:, 0] - tip[:, 0])
    direction = _find_directions(elements)
    turned = (np.conj(direction) / length)[:, None]
    return elements.move(tip, turned), tip[:, 0], direction, length


def _find_directions(elements: Elements) -> Complex:
    """The directions (k,) in which the tips of cracks with these elements (k, m) point.

    Of a straight crack it is that of all of it: the ends of a short element have lost digits if it lies far from the
    origin.
    """
    start, end = elements.start, elements.end
    chord = end - start
    rounding = 16 * np.finfo(float).eps * np.abs(end) / np.abs(chord)
    longest = np.take_along_axis(chord, np.argmax(np.abs(chord), axis=1)[:, None], axis=1)
    straight = ~(np.abs(np.angle(chord / longest)) > STRAIGHT + rounding).any(axis=1) & ~elements.turns.any(axis=1)
    leading = np.where(straight, end[:, -1] - start[:, 0], elements.directions()[0][:, 0])
    return np.asarray(-leading / np.abs(leading))


def _list_outward(mesh: Mesh, elements: Integer, outward: Bool) -> Integer:
    """The nodes (k, m (p + 1)) of elements (k, m) in the order in which they are met when leaving the tip."""
    within = np.arange(mesh.order + 1)
    along = np.where(outward[..., None], within, within[::-1])
    return np.asarray((elements[..., None] * (mesh.order + 1) + along).reshape(len(elements), -1))
