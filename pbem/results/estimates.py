"""Estimated discretisation errors of a step: what differs from the second solution, divided by what its mesh costs."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from pbem.contact.laws import collect_laws
from pbem.mesh.interpolation import split_faces
from pbem.mesh.mesh import Mesh, sort_pairs
from pbem.model.model import Model
from pbem.results.between import Violations
from pbem.results.tips import collect_tip_rules
from pbem.solve.beside import Beside
from pbem.solve.step import ContactState, Step

Complex = NDArray[np.complex128]
Integer = NDArray[np.int64]
Real = NDArray[np.float64]

# The error of the second solution over that of the run, less one, by order: 2^rate - 1 for the rate order + 1, at most
# 5; with the order lowered by one. Measured over the problems with known answers by scripts/bench_estimate.py.
MERGED = (1.0, 3.0, 5.0, 5.0)
LOWERED = 8.0
# Of the largest displacement: jumps and factors below are rounding, and have no relative error.
ROUNDING = 1e-8
# Differences of K pass through zero by chance; of the relative error of a crack's jumps this part at least is K's.
LEAST_FACTOR_ERROR = 0.02


PAIR_FIELDS = ("opening", "slip", "traction_n", "traction_s")


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
    """The largest values so far: of a reaction (magnitude), of a jump on any interface, of the tractions on an
    interface (root of their mean square), of the traction of a pair, of a factor K, of a displacement."""

    reactions: float = 0.0
    jumps: float = 0.0
    tractions: float = 0.0
    peak: float = 0.0
    factors: float = 0.0
    displacement: float = 0.0


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
    difference of displacements and of tractions (stress times length squared); jumps (e,): estimated error of opening
    and slip over the largest jump in the model.
    """

    def __init__(self, model: Model, mesh: Mesh, beside: Beside | None) -> None:
        self._model, self._mesh, self._beside = model, mesh, beside
        self._interfaces = list(sort_pairs(mesh).values())
        self._rules = collect_tip_rules(model, mesh)
        self._gap = collect_laws(model, mesh).gap
        self.energy, self.jumps = np.zeros((2, mesh.elements)), np.zeros(mesh.elements)
        self.scales = Scales()
        if beside is not None:
            self._others = list(sort_pairs(beside.mesh).items())
            self._other_rules = collect_tip_rules(beside.model, beside.mesh)
            self._other_gap = collect_laws(beside.model, beside.mesh).gap
            self._divisor = MERGED[model.analysis.order] if beside.kind == "merged" else LOWERED

    def measure_scales(self, step: Step) -> Scales:
        """The largest values of one step."""
        contact, mesh, weight = step.contact, self._mesh, self._mesh.pairs.weight
        factors = self._rules.evaluate_factors(contact)
        square = weight * (contact.traction_n**2 + contact.traction_s**2)
        return Scales(
            reactions=_largest(np.abs(sum_reactions(self._model, mesh, step))),
            jumps=max(_largest(contact.opening - self._gap), _largest(contact.slip)),
            tractions=max((float(np.sqrt(square[p].sum() / weight[p].sum())) for p in self._interfaces), default=0.0),
            peak=float(np.sqrt(_largest(contact.traction_n**2 + contact.traction_s**2))),
            factors=max(_largest(each) for each in factors),
            displacement=_largest(np.abs(step.displacement)),
        )

    def compare(self, step: Step, second: Step | None) -> tuple[Estimates, Relative]:
        """The estimated errors of a step; second: the same step of the second solution, None if that has failed."""
        now = self.measure_scales(step)
        self.scales = Scales(*(max(old, vars(now)[name]) for name, old in vars(self.scales).items()))
        if second is None or self._beside is None:
            estimates = self._know_nothing()
        else:
            estimates = self._subtract(step, second, self._beside)
            self.energy = np.maximum(self.energy, measure_energy(self._model, self._mesh, self._beside, step, second))
            self.jumps = np.maximum(self.jumps, self._locate_jumps(step.contact, second.contact, self._beside))
        return estimates, self._relate(estimates)

    def _know_nothing(self) -> Estimates:
        nothing = {name: np.full(shape, np.nan) for name, shape in list_datasets(self._model, self._mesh).items()}
        return Estimates(**{each.name: nothing[each.name] for each in fields(Estimates) if nothing[each.name].ndim},
                         displacement=np.nan)

    def _subtract(self, step: Step, second: Step, beside: Beside) -> Estimates:
        by = 1.0 / self._divisor
        forces = by * (sum_reactions(self._model, self._mesh, step) - sum_reactions(beside.model, beside.mesh, second))
        errors = self._subtract_pairs(step.contact, second.contact, beside)
        both = self._rules.evaluate_factors(step.contact), self._other_rules.evaluate_factors(second.contact)
        cracks = len(self._model.crack_tips)  # the two meshes need not see the same cracks along interfaces
        factors = [by * np.abs(mine[:cracks] - other[:cracks]) for mine, other in zip(*both, strict=True)]
        moved = subtract_displacements(self._mesh, beside, step, second)
        opening, slip, traction_n, traction_s = (by * each for each in errors)
        least = self._bound_factors(step.contact, np.fmax(opening, slip))
        KI, KII = (np.maximum(each, least) for each in factors)
        return Estimates(
            np.abs(np.stack([forces.real, forces.imag], axis=1)), opening, slip, traction_n, traction_s, KI, KII,
            by * _largest(np.abs(moved[~beside.mesh.node_crack])),
        )

    def _bound_factors(self, contact: ContactState, jumps: Real) -> Real:
        """The least error (cracks, 1) of the factors of each crack for the errors (i,) of the interfaces' jumps."""
        KI, KII = self._rules.evaluate_factors(contact)
        number = {name: i for i, name in enumerate(sort_pairs(self._mesh))}
        least = np.zeros((len(self._model.crack_tips), 1))
        for crack, name in enumerate(self._model.crack_tips):
            own = self._interfaces[number[name]]
            largest = max(_largest(contact.opening[own] - self._gap[own]), _largest(contact.slip[own]))
            factor = max(_largest(KI[crack]), _largest(KII[crack]))
            least[crack] = LEAST_FACTOR_ERROR * jumps[number[name]] / largest * factor if largest > 0 else 0.0
        return least

    def _subtract_pairs(self, mine: ContactState, other: ContactState, beside: Beside) -> tuple[Real, Real, Real, Real]:
        """Per interface: largest differences of opening and slip, mean ones of the tractions."""
        difference = {name: self._subtract_field(name, mine, other, beside) for name in PAIR_FIELDS}
        weight = beside.mesh.pairs.weight
        of = dict(self._others)
        found = []
        for name in sort_pairs(self._mesh):
            pairs = of.get(name, np.zeros(0, dtype=np.int64))
            largest = [_largest(difference[kind][pairs]) for kind in ("opening", "slip")]
            mean = [
                float(np.sqrt((weight * difference[kind] ** 2)[pairs].sum() / max(weight[pairs].sum(), 1e-300)))
                for kind in ("traction_n", "traction_s")
            ]
            # Where the second solution has its pairs on the other face nothing is known.
            seen = float(weight[pairs] @ beside.seen[pairs]) >= 0.5 * float(weight[pairs].sum())
            found.append([*largest, *mean] if len(pairs) and seen else [np.nan] * 4)
        table = np.array(found).reshape(-1, 4)
        return table[:, 0], table[:, 1], table[:, 2], table[:, 3]

    def _subtract_field(self, name: str, mine: ContactState, other: ContactState, beside: Beside) -> Real:
        """At the pairs of the second solution; zero where the run has none."""
        values = beside.carry_pairs(getattr(mine, name), name in ("opening", "slip")) - getattr(other, name)
        if name == "opening":
            # The initial gap is no part of the error: between the nodes it need not be a polynomial.
            values = values - (beside.carry_pairs(self._gap, True) - self._other_gap)
        return np.where(beside.seen, values, 0.0)

    def _locate_jumps(self, mine: ContactState, other: ContactState, beside: Beside) -> Real:
        """Estimated error of the jumps on each element of the run (e,), over the largest jump so far.

        The mean over each coarse element is left out: it comes from elsewhere.
        """
        pairs, result = beside.mesh.pairs, np.zeros(self._mesh.elements)
        element = beside.carry.nearest[pairs.slot] // (self._mesh.order + 1)
        own, of = np.unique(pairs.slot // (beside.mesh.order + 1), return_inverse=True)
        if self.scales.jumps > ROUNDING * self.scales.displacement:
            for name in ("opening", "slip"):
                errors = self._subtract_field(name, mine, other, beside) / (self._divisor * self.scales.jumps)
                mean = np.bincount(of, errors, len(own)) / np.bincount(of, minlength=len(own))
                errors = errors - np.where(beside.mesh.tip[own] > 0, 0.0, mean)[of]
                np.maximum.at(result, element, np.abs(errors))
        return result

    def relate_violations(self, violations: Violations) -> Violations:
        """As parts of the largest jump (penetration) and of the largest traction so far; 0 where these are rounding."""
        scales, modulus = self.scales, max(region.material.plane_modulus for region in self._model.regions)
        jump = scales.jumps if scales.jumps > ROUNDING * scales.displacement else np.inf
        least = ROUNDING * scales.displacement / self._model.size * modulus
        peak = scales.peak if scales.peak > least else np.inf
        return Violations(violations.penetration / jump, violations.tension / peak, violations.cone / peak)

    def _relate(self, estimates: Estimates) -> Relative:
        scales, model = self.scales, self._model
        moved = scales.displacement
        modulus = max(region.material.plane_modulus for region in model.regions)
        strain = ROUNDING * moved / model.size
        return Relative(
            reactions=_divide(_worst(estimates.reactions), scales.reactions, strain * modulus * model.size),
            jumps=_divide(max(_worst(estimates.opening), _worst(estimates.slip), key=_nan_first), scales.jumps,
                          ROUNDING * moved),
            tractions=_divide(max(_worst(estimates.traction_n), _worst(estimates.traction_s), key=_nan_first),
                              scales.tractions, strain * modulus),
            factors=_divide(max(_worst_known(estimates.KI, self._rules.is_tip),
                                _worst_known(estimates.KII, self._rules.is_tip), key=_nan_first),
                            scales.factors, strain * modulus * np.sqrt(model.size)),
            displacement=_divide(estimates.displacement, moved, 0.0),
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


def sum_reactions(model: Model, mesh: Mesh, step: Step) -> Complex:
    """Integral (c,) of the traction over every outer curve, complex."""
    numbers = {name: number for number, name in enumerate(model.conditions)}
    of = np.array([numbers.get(name, -1) for name in mesh.curve_names], dtype=np.int64)[mesh.node_curve]
    outer = of >= 0
    force = (mesh.weight * step.traction[: mesh.nodes])[outer]
    count = len(numbers)
    return np.bincount(of[outer], force.real, count) + 1j * np.bincount(of[outer], force.imag, count)


def subtract_displacements(mesh: Mesh, beside: Beside, step: Step, second: Step) -> Complex:
    """At the nodes of the coarser mesh (c,): displacement of the run less that of the second solution; on cracks that
    of the jumps."""
    carry, found = beside.carry, []
    for each, moved in ((mesh, step.displacement), (beside.mesh, second.displacement)):
        first, opposite = split_faces(each, moved)
        found.append(np.where(each.node_crack, first - opposite, first))
    carried = np.where(beside.mesh.node_crack, carry.rooted @ found[0], carry.plain @ found[0])
    return np.asarray(carried - found[1])


def measure_energy(model: Model, mesh: Mesh, beside: Beside, step: Step, second: Step) -> Real:
    """Energies (2, e) of the differences on every element of the run's mesh: stress times length squared.

    With h an element's length and E the plane modulus, E/h |du|^2 and h/E |dt|^2 over the element, the parts of the
    norms of displacements (half a derivative) and tractions (minus half) in which the equations are elliptic. Of du the
    mean over the element is left out: motions of what is far away are none of its own.
    """
    coarse = beside.mesh
    du = subtract_displacements(mesh, beside, step, second).reshape(coarse.elements, -1)
    dt = beside.carry.plain @ step.traction[: mesh.nodes] - second.traction[: coarse.nodes]
    weight = coarse.weight.reshape(coarse.elements, -1)
    length = weight.sum(axis=1)
    mean = np.where(coarse.tip > 0, 0.0, (weight * du).sum(axis=1) / length)
    du = du - mean[:, None]
    modulus = np.array([region.material.plane_modulus for region in model.regions])[coarse.region]
    dt = dt.reshape(coarse.elements, -1)
    element = beside.carry.nearest // (mesh.order + 1)
    return np.stack([
        np.bincount(element, (weight * factor[:, None] * np.abs(field) ** 2).ravel(), mesh.elements).astype(float)
        for factor, field in ((modulus / length, du), (length / modulus, dt))
    ])  # fmt: skip


def _largest(values: NDArray[np.floating]) -> float:
    """The largest magnitude; 0 without any, NaN left out."""
    known = np.abs(values[~np.isnan(values)])
    return float(known.max(initial=0.0))


def _worst(values: Real) -> float:
    """The largest; NaN if any is, 0 without any."""
    return float(values.max()) if values.size else 0.0


def _worst_known(values: Real, is_tip: NDArray[np.bool_]) -> float:
    # The tips of cracks come first, then those of cracks along interfaces, which have no K.
    return _worst(values.ravel()[is_tip[: values.size]])


def _nan_first(value: float) -> float:
    return np.inf if np.isnan(value) else value


def _divide(error: float, scale: float, rounding: float) -> float:
    if np.isnan(error):
        return error
    return error / scale if scale > rounding else 0.0
