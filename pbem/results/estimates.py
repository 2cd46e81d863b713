"""Estimated discretisation errors of a step: what differs from the second solution, divided by what its mesh costs."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pbem.arrays import Bool, Real
from pbem.contact.laws import collect_laws
from pbem.mesh.mesh import Mesh, sort_pairs
from pbem.model.model import Model
from pbem.results.absent import Absence
from pbem.results.between import Violations
from pbem.results.differences import (
    bound_reactions,
    measure_distortion,
    measure_energy,
    subtract_displacements,
    sum_reactions,
    sum_sizes,
)
from pbem.results.divisors import Divisors
from pbem.results.rates import EndFinder, Ends
from pbem.results.short_zones import bound_short_zones
from pbem.results.stiff_tips import StiffTips
from pbem.results.stuck_ends import StuckEnds
from pbem.results.tips import TipRules, collect_tip_rules
from pbem.solve.estimate.coarser_mesh import Beside
from pbem.solve.problem.step import ContactState, Step

# Of the largest displacement: jumps and factors below are rounding, and have no relative error.
ROUNDING = 1e-8
# Of the modulus times the largest displacement over the model's size: no traction is known better. Nor is the modulus
# times a displacement over the size known better than this part of the largest traction.
DIGITS = 1e-13
# Differences of K pass through zero by chance; of the relative error of a crack's jumps this part at least is K's.
LEAST_FACTOR_ERROR = 0.005
# Jumps below this part of what the tractions strain over an interface are none: where faces stay together as they are
# by symmetry, all of a jump is error.
LEAST_JUMP = 1e-2
# Reactions below this part of the forces without signs on a curve are none: where loads balance each other along it,
# all of its reaction is error. Slender beams have less than that of the forces at their ends from 1:600 on.
LEAST_REACTION = 1e-3

JUMPS = ("opening", "slip")


@dataclass(frozen=True)
class Estimates:
    """Estimated errors of one step; NaN where there is no second solution.

    reactions (c, 2): force, of each outer curve along x and y. opening, slip (i,): largest error on each interface with
    pairs, length. traction_n, traction_s (i,): root of the mean square error over the interface, stress. KI, KII
    (cracks, 2): at start and end, NaN where there is no tip. displacement: largest error on outer curves and
    interfaces, length.
    """

    reactions: Real
    opening: Real
    slip: Real
    traction_n: Real
    traction_s: Real
    KI: Real
    KII: Real
    displacement: float


@dataclass(frozen=True)
class Scales:
    """The largest values so far.

    reactions: magnitude, at least LEAST_REACTION; jumps: on any interface, at least LEAST_JUMP; tractions: root of
    their mean square on an interface; peak: traction of a pair; factors: K; displacement; strained: modulus times
    strain of a region, or what counts as much (see _measure_strained), of which a part ROUNDING is rounding.
    """

    reactions: float = 0.0
    jumps: float = 0.0
    tractions: float = 0.0
    peak: float = 0.0
    factors: float = 0.0
    displacement: float = 0.0
    strained: float = 0.0


@dataclass(frozen=True)
class Relative:
    """Estimated errors of a step over the largest values so far: 0 where these are rounding, NaN where unknown."""

    reactions: float
    jumps: float
    tractions: float
    factors: float
    displacement: float


class Comparison:
    """Compares the steps of a run with those of the second solution; on one rank.

    Where to refine, the largest over the steps so far, on each element of the run's mesh: energy (2, e) of the
    difference of displacements and of tractions (stress times length squared); local (e,): estimated error of opening
    and slip over the largest jump in the model, and of K where the length of the element at the tip makes it: at_tips.
    """

    def __init__(
        self, model: Model, mesh: Mesh, beside: Beside | None, as_they_are: bool = False, rules: TipRules | None = None
    ) -> None:
        """as_they_are: differences are not divided: with a run that is exact they are the errors of the other one.
        rules: of the run's tips, if they are known."""
        self._model, self._mesh, self._beside = model, mesh, beside
        self._sorted = sort_pairs(mesh)
        self._interfaces = list(self._sorted.values())
        self._known, self._as_they_are = rules, as_they_are
        self._absence = Absence(model, mesh, np.zeros(0, dtype=np.int64))
        self._softest = min((region.material.plane_modulus for region in model.regions), default=np.inf)
        laws = collect_laws(model, mesh)
        self._gap = laws.gap
        self._stuck_ends, self._stiff_tips = StuckEnds(model, mesh, laws), StiffTips(model, mesh, laws)
        self.energy, (self.local, self.at_tips) = np.zeros((2, mesh.elements)), np.zeros((2, mesh.elements))
        self.scales = Scales()
        if beside is not None:
            self._others = list(sort_pairs(beside.mesh).items())
            self._other_gap = collect_laws(beside.model, beside.mesh).gap
            self._ends = EndFinder(mesh, beside)
            self._divisors = Divisors(model, beside, as_they_are)

    @cached_property
    def _rules(self) -> TipRules:
        return self._known or collect_tip_rules(self._model, self._mesh)

    @cached_property
    def _other_rules(self) -> TipRules:
        assert self._beside is not None
        return collect_tip_rules(self._beside.model, self._beside.mesh)

    def measure_scales(self, step: Step) -> Scales:
        """The largest values of one step."""
        # Of what a stage has removed: the gap that was there is no jump.
        contact = self._absence.blank(replace(step, interior=None)).contact
        mesh, weight = self._mesh, np.asarray(self._mesh.pairs.weight)
        factors = self._rules.evaluate_factors(contact)
        square = weight * (contact.traction_n**2 + contact.traction_s**2)
        tractions = max((float(np.sqrt(square[p].sum() / weight[p].sum())) for p in self._interfaces), default=0.0)
        longest = max((float(weight[p].sum()) for p in self._interfaces), default=0.0)
        least = LEAST_JUMP * tractions / max(region.material.plane_modulus for region in self._model.regions) * longest
        return Scales(
            reactions=max(_largest(np.abs(sum_reactions(self._model, mesh, step))),
                          LEAST_REACTION * _largest(sum_sizes(self._model, mesh, step))),
            jumps=max(_largest(contact.opening - self._gap), _largest(contact.slip), least),
            tractions=tractions,
            peak=float(np.sqrt(_largest(contact.traction_n**2 + contact.traction_s**2))),
            factors=max(_largest(each) for each in factors),
            displacement=_largest(np.abs(step.displacement)),
            strained=self._measure_strained(step),
        )

    def _measure_strained(self, step: Step) -> float:
        """The largest modulus times strain, stress, of any region, each with its own modulus and its own displacement.

        A stiff region goes along with a soft one: its strain is what is left of its displacement without the motion as
        a rigid body. Where all of it is such a motion, the softest modulus counts.
        """
        model, mesh, moved = self._model, self._mesh, step.displacement[: self._mesh.nodes]
        moduli = np.array([region.material.plane_modulus for region in model.regions])
        largest = _largest(np.abs(step.displacement))
        strained = max(moduli.min(), DIGITS / ROUNDING * moduli.max()) * largest
        bounds = np.searchsorted(mesh.node_region, np.arange(len(moduli) + 1))
        for number, modulus in enumerate(moduli):
            own = slice(bounds[number], bounds[number + 1])
            strained = max(strained, modulus * measure_distortion(mesh.position[own], moved[own]))
        return float(strained / model.size)

    def compare(self, step: Step, second: Step | None) -> tuple[Estimates, Relative]:
        """The estimated errors of a step; second: the same step of the second solution, None if that has failed."""
        now = self.measure_scales(step)
        self.scales = Scales(*(max(old, vars(now)[name]) for name, old in vars(self.scales).items()))
        if second is None or self._beside is None:
            estimates = self._know_nothing()
        else:
            energy = measure_energy(self._model, self._mesh, self._beside, step, second)
            least, ends = self._bound_jumps(step), self._ends.find(step.contact, second.contact)
            by = self._divisors.of_jumps(ends, energy)
            jumps = self._divide_jumps(step.contact, second.contact, self._beside, by)
            estimates = self._subtract(step, second, self._beside, energy, least, jumps, ends)
            self.energy = np.maximum(self.energy, energy)
            located = self._locate_jumps(jumps, self._beside, least)
            self.local = np.maximum(self.local, located)
        return estimates, self._relate(estimates)

    def _know_nothing(self) -> Estimates:
        nothing = {name: np.full(shape, np.nan) for name, shape in list_datasets(self._model, self._mesh).items()}
        return Estimates(**{each.name: nothing[each.name] for each in fields(Estimates) if nothing[each.name].ndim},
                         displacement=np.nan)

    def _subtract(
        self, step: Step, second: Step, beside: Beside, energy: Real, least_jumps: Real, jumps: Real, ends: Ends
    ) -> Estimates:
        """Differences over the divisors (theory, 77); least_jumps, jumps: of `_bound_jumps` and `_divide_jumps`."""
        mine, other = sum_reactions(self._model, self._mesh, step), sum_reactions(beside.model, beside.mesh, second)
        forces = (mine - other) / self._divisors.of_forces(energy)
        opening, slip, traction_n, traction_s = self._subtract_pairs(step.contact, second.contact, beside, jumps, ends)
        of_zones = [least_jumps[own].max(axis=0) for own in self._interfaces]
        opening, slip = np.maximum([opening, slip], np.reshape(of_zones, (-1, 2)).T)
        both = self._rules.evaluate_factors(step.contact), self._other_rules.evaluate_factors(second.contact)
        cracks = len(self._model.crack_tips)  # the two meshes need not see the same cracks along interfaces
        by = self._divisors.of_factors(energy)
        factors = [np.abs(one[:cracks] - two[:cracks]) / by for one, two in zip(*both, strict=True)]
        moved = subtract_displacements(self._mesh, beside, step, second) / self._divisors.of_displacements(energy)
        KI, KII = np.maximum(factors, self._bound_factors(step, np.fmax(opening, slip)))
        reactions = np.abs(np.stack([forces.real, forces.imag], axis=1))
        if not self._as_they_are:
            reactions = np.maximum(reactions, bound_reactions(self._model, self._mesh, step))
        return Estimates(
            reactions, opening, slip, traction_n, traction_s, KI, KII,
            _largest(np.abs(moved[~beside.mesh.node_crack])),
        )

    def _bound_jumps(self, step: Step) -> Real:
        """The least errors (m, 2) of opening and slip at the run's pairs."""
        contact = self._absence.blank(replace(step, interior=None)).contact
        if self._as_they_are:
            return np.zeros((len(contact.slip), 2))
        of_zones = bound_short_zones(self._model, self._sorted, contact.opening - self._gap, contact.slip)
        return np.maximum(of_zones, self._stuck_ends.bound(replace(step, contact=contact)))

    def _bound_factors(self, step: Step, jumps: Real) -> Real:
        """The least errors (2, cracks, 2) of KI and KII of each crack for the errors (i,) of the interfaces' jumps."""
        contact = step.contact
        factors = np.stack(self._rules.evaluate_factors(contact))[:, : len(self._model.crack_tips)]
        if self._as_they_are:
            return np.zeros(factors.shape)
        number = {name: i for i, name in enumerate(sort_pairs(self._mesh))}
        least = np.zeros((len(self._model.crack_tips), 1))
        for crack, name in enumerate(self._model.crack_tips):
            own = self._interfaces[number[name]]
            largest = max(_largest(contact.opening[own] - self._gap[own]), _largest(contact.slip[own]))
            factor = _largest(factors[:, crack])
            least[crack] = LEAST_FACTOR_ERROR * jumps[number[name]] / largest * factor if largest > 0 else 0.0
        at_tips = np.fmax(self._rules.bound_short(*factors), self._stiff_tips.bound(step, factors))
        self._locate_factors(at_tips)
        return np.fmax(least, at_tips)

    def _locate_factors(self, least: Real) -> None:
        """Tell the elements at tips what their lengths alone make of errors (2, cracks, 2) of factors."""
        by_end, names = np.nan_to_num(least).max(axis=0) / (self.scales.factors or np.inf), list(self._model.crack_tips)
        for crack, end in np.argwhere(by_end > 0):
            element = self._mesh.pairs.slave[self._sorted[names[crack]][-end]] // (self._mesh.order + 1)
            self.at_tips[element] = max(self.at_tips[element], by_end[crack, end])
        np.maximum(self.local, self.at_tips, out=self.local)

    def _subtract_pairs(
        self, mine: ContactState, other: ContactState, beside: Beside, jumps: Real, ends: Ends
    ) -> tuple[Real, Real, Real, Real]:
        """Per interface (i,): estimated errors, of opening and slip the largest, of the tractions the mean ones."""
        opening, slip = jumps
        normal, tangential = self._subtract_tractions(mine, other, beside, ends)
        weight = np.asarray(beside.mesh.pairs.weight)
        borne = weight * (other.traction_n**2 + other.traction_s**2)
        of = dict(self._others)
        found = []
        for name in sort_pairs(self._mesh):
            pairs = of.get(name, np.zeros(0, dtype=np.int64))
            whole, length = (float(weight[pairs] @ each) for each in (np.ones(len(pairs)), beside.seen[pairs]))
            largest = [_largest(each[pairs]) for each in (opening, slip)]
            # Where the second solution has its pairs on the other face nothing is known. On faces that touch in a small
            # part what is not seen may be a few long elements at the ends of what is opposite.
            most = beside.seen[pairs] @ borne[pairs] >= 0.5 * borne[pairs].sum()
            seen = length >= 0.5 * whole or (most and np.count_nonzero(beside.seen[pairs]) >= 0.5 * len(pairs))
            along = max(whole if length >= 0.5 * whole else length, 1e-300)
            mean = [float(np.sqrt((weight[pairs] @ each[pairs] ** 2) / along)) for each in (normal, tangential)]
            found.append([*largest, *mean] if len(pairs) and seen else [np.nan] * 4)
        table = np.array(found).reshape(-1, 4)
        return table[:, 0], table[:, 1], table[:, 2], table[:, 3]

    def _divide_jumps(self, mine: ContactState, other: ContactState, beside: Beside, by: Real) -> Real:
        """Estimated errors (2, c) of opening and slip at the pairs of the second solution; by (c,): the divisors.

        Where displacements follow a power near zero differences are divided by next to nothing, but jumps that are to
        vanish at a crack's end are off by no more than what they are.
        """
        found = []
        for name in JUMPS:
            differences = self._subtract_jumps(name, mine, other, beside)
            most = np.abs(getattr(other, name) - (self._other_gap if name == "opening" else 0.0))
            most = np.maximum(most, np.abs(differences))
            found.append(np.where(self._divisors.weak, np.clip(differences / by, -most, most), differences / by))
        return np.stack(found)

    def _subtract_jumps(self, name: str, mine: ContactState, other: ContactState, beside: Beside) -> Real:
        """Differences at the pairs of the second solution; zero where the run has none."""
        values = beside.carry_pairs(getattr(mine, name), True) - getattr(other, name)
        if name == "opening":
            # The initial gap is no part of the error: between the nodes it need not be a polynomial.
            values = values - (beside.carry_pairs(self._gap, True) - self._other_gap)
        return np.where(beside.seen, values, 0.0)

    def _subtract_tractions(
        self, mine: ContactState, other: ContactState, beside: Beside, ends: Ends
    ) -> tuple[Real, Real]:
        """Estimated errors at the pairs of the second solution; zero where the run has none."""
        found = np.zeros((2, len(beside.seen)))
        for difference, name in zip(found, ("traction_n", "traction_s"), strict=True):
            own = getattr(mine, name)
            carried = np.where(ends.mixed, self._ends.read_between(own), beside.carry_pairs(own, False))
            difference[beside.seen] = (carried - getattr(other, name))[beside.seen]
        normal, tangential = found / self._divisors.of_tractions(ends, found)
        return normal, tangential

    def _locate_jumps(self, jumps: Real, beside: Beside, least: Real) -> Real:
        """Estimated error of the jumps on each element of the run (e,), over the largest jump so far; jumps: of
        `_divide_jumps`, least: of `_bound_jumps`.

        The mean over each coarse element is left out, or that over the next one where it is in a corner: it comes from
        elsewhere.
        """
        pairs, result = beside.mesh.pairs, np.zeros(self._mesh.elements)
        element = beside.carry.nearest[pairs.slave] // (self._mesh.order + 1)
        own, number = pairs.slave // (beside.mesh.order + 1), beside.mesh.elements
        if self.scales.jumps > ROUNDING * self.scales.displacement:
            at_least = least.max(axis=1) / self.scales.jumps
            np.maximum.at(result, self._mesh.pairs.slave // (self._mesh.order + 1), at_least)
            for errors in jumps / self.scales.jumps:
                mean = np.bincount(own, errors, number) / np.maximum(np.bincount(own, minlength=number), 1)
                for of_rest in (mean, self._divisors.look_beyond(mean)):
                    left = errors - np.where(beside.mesh.tip > 0, 0.0, of_rest)[own]
                    np.maximum.at(result, element, np.abs(left))
        return result

    def relate_violations(self, violations: Violations) -> Violations:
        """As parts of the largest jump (penetration) and of the largest traction so far; 0 where these are rounding."""
        scales = self.scales
        jump = scales.jumps if scales.jumps > ROUNDING * scales.displacement else np.inf
        peak = scales.peak if scales.peak > ROUNDING * scales.strained else np.inf
        return Violations(violations.penetration / jump, violations.tension / peak, violations.cone / peak)

    def _relate(self, estimates: Estimates) -> Relative:
        scales, size = self.scales, self._model.size
        moved, rounding = scales.displacement, ROUNDING * scales.strained
        # Under in-situ stress nothing but rounding may have moved yet.
        borne = max(scales.peak, scales.reactions / size) * size / self._softest
        return Relative(
            reactions=_divide(_worst(estimates.reactions), scales.reactions, rounding * size),
            jumps=_divide(max(_worst(estimates.opening), _worst(estimates.slip), key=_nan_first), scales.jumps,
                          ROUNDING * moved),
            tractions=_divide(max(_worst(estimates.traction_n), _worst(estimates.traction_s), key=_nan_first),
                              scales.tractions, rounding),
            factors=_divide(max(_worst_known(estimates.KI, self._rules.is_tip),
                                _worst_known(estimates.KII, self._rules.is_tip), key=_nan_first),
                            scales.factors, rounding * np.sqrt(size)),
            displacement=_divide(estimates.displacement, moved, DIGITS * borne),
        )  # fmt: skip


def list_datasets(model: Model, mesh: Mesh) -> dict[str, tuple[int, ...]]:
    """Names and shapes, without the steps, of what `to_rows` gives."""
    interfaces, cracks = len(sort_pairs(mesh)), len(model.crack_tips)
    shapes: dict[str, tuple[int, ...]] = {"reactions": (len(model.conditions), 2)}
    shapes |= dict.fromkeys(("opening", "slip", "traction_n", "traction_s", *VIOLATIONS), (interfaces,))
    shapes |= dict.fromkeys(("KI", "KII"), (cracks, 2))
    return shapes | dict.fromkeys(("displacement", *RELATIVE), ())


VIOLATIONS = tuple(field.name for field in fields(Violations))
RELATIVE = tuple(f"relative_{field.name}" for field in fields(Relative))


def to_rows(estimates: Estimates, relative: Relative, parts: Violations) -> dict[str, Real]:
    """One step's entries of the datasets under /estimates; parts: of `Comparison.relate_violations`."""
    rows = {name: value for name, value in vars(parts).items()}
    rows |= {name: np.asarray(value) for name, value in vars(estimates).items()}
    return rows | {f"relative_{name}": np.asarray(value) for name, value in vars(relative).items()}


def _largest(values: NDArray[np.floating]) -> float:
    """The largest magnitude; 0 without any, NaN left out."""
    known = np.abs(values[~np.isnan(values)])
    return float(known.max(initial=0.0))


def _worst(values: Real) -> float:
    """The largest; NaN if any is, 0 without any."""
    return float(values.max()) if values.size else 0.0


def _worst_known(values: Real, is_tip: Bool) -> float:
    # The tips of cracks come first, then those of cracks along interfaces, which have no K.
    return _worst(values.ravel()[is_tip[: values.size]])


def _nan_first(value: float) -> float:
    return np.inf if np.isnan(value) else value


def _divide(error: float, scale: float, rounding: float) -> float:
    if np.isnan(error):
        return error
    return error / scale if scale > rounding else 0.0
