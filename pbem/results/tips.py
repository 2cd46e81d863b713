"""Stress-intensity factors at the tips of cracks, from the square root in which the jump of displacement begins."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbem.contact.laws import collect_laws
from pbem.mesh.interpolation import find_coordinates
from pbem.mesh.mesh import Mesh, sort_pairs
from pbem.model.model import Model
from pbem.solve.step import ContactState

Real = NDArray[np.float64]
Integer = NDArray[np.int64]

# Without tip elements: the part of the crack's length next to the tip whose jumps are looked at.
REACH = 0.1


@dataclass(frozen=True)
class TipRules:
    """How the factors follow from the jumps at the pairs: K of an end is the sum of coefficient (stress/sqrt(length))
    times the jump, for each of its components, over the terms (t,) with its number.

    cracks: their names. is_tip (2 cracks,): of the start and the end of the first crack, of the second, ... end (t,):
    number among these. pair, coefficient (t,). gap (m,): the initial gap of all pairs.
    """

    cracks: tuple[str, ...]
    is_tip: NDArray[np.bool_]
    end: Integer
    pair: Integer
    coefficient: Real
    gap: Real

    def evaluate(self, contact: ContactState) -> dict[str, tuple[Real, Real]]:
        """KI and KII (2,) of every crack at its start and its end, as in `evaluate_all`."""
        return dict(zip(self.cracks, zip(*self.evaluate_all(contact), strict=True), strict=True))

    def evaluate_all(self, contact: ContactState) -> tuple[Real, Real]:
        """KI and KII (cracks, 2) at start and end, stress times sqrt(length); NaN where no tip is.

        KI > 0 opens; KII > 0 if the face on the left of the crack's direction moves along it, at both ends. Where no
        pair of the tip's element is open or has an elastic joint, KI is exactly zero.
        """
        factors = []
        for jump in (contact.opening - self.gap, -contact.slip):
            total = np.bincount(self.end, self.coefficient * jump[self.pair], minlength=len(self.is_tip))
            # No negative zeros.
            factors.append(np.where(self.is_tip, total + 0.0, np.nan).reshape(-1, 2))
        return factors[0], factors[1]


Terms = tuple[Integer, Integer, Real]


def collect_tip_rules(model: Model, mesh: Mesh) -> TipRules:
    """How the factors follow from the jumps at the pairs.

    Near a tip the jump is (8/E') K sqrt(rho/(2 pi)), rho being the distance from the tip along the crack. On a tip
    element its components along the normal and the crack are sums of t^(k + 1/2), and rho tends to t times the distance
    of the element's ends, on arcs too (the derivative of the arc length by t at the tip is the chord). Without tip
    elements the jump over sqrt(rho) is extrapolated linearly to the tip from its neighbourhood, the last element left
    out, which cannot follow the root.
    """
    modulus = {name: region.material.plane_modulus for region in model.regions for name in region.cracks}
    cracks = tuple(model.crack_tips)
    is_tip = np.array(list(model.crack_tips.values()), dtype=bool).ravel()
    pairs = sort_pairs(mesh)
    per_element = mesh.order + 1
    on_elements, along = [], []
    for number in np.flatnonzero(is_tip):
        name, end = cracks[number // 2], int(number % 2)
        own = pairs[name][::-1] if end else pairs[name]  # from the tip on
        element = int(mesh.pairs.first[own[0]]) // per_element
        if mesh.tip[element] == end + 1 or len(own) == per_element:
            on_elements.append((number, element, end, own[:per_element]))
        else:
            along.append(_extrapolate(number, mesh.pairs.arc_length[own], model.curves[name].length, end, own, mesh))
    terms = [_read_from_elements(mesh, on_elements), *along] if on_elements else along
    nothing = (np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros(0))
    numbers, at, coefficient = (np.concatenate(parts) for parts in zip(nothing, *terms, strict=True))
    scale = np.repeat([modulus[name] / 8 * np.sqrt(2 * np.pi) for name in cracks], 2)
    coefficient = scale[numbers] * coefficient if len(numbers) else coefficient
    return TipRules(cracks, is_tip, numbers, at, coefficient, collect_laws(model, mesh).gap)


def _read_from_elements(mesh: Mesh, tips: list[tuple[int, int, int, Integer]]) -> Terms:
    """Terms of ends with a tip element, or with one element alone; their numbers, elements, which ends, and pairs."""
    number, element, end = (np.array(column) for column in list(zip(*tips, strict=True))[:3])
    s = find_coordinates(mesh.start[element], mesh.end[element], mesh.sweep[element],
                         mesh.position.reshape(mesh.elements, -1)[element])
    t = np.where(end[:, None] == 0, 0.5 * (1 + s), 0.5 * (1 - s[:, ::-1]))
    first_shapes = np.linalg.inv(t[..., None] ** (np.arange(mesh.order + 1) + 0.5))[:, 0]
    coefficient = first_shapes / np.sqrt(abs(mesh.end[element] - mesh.start[element]))[:, None]
    pairs = np.array([own for *_, own in tips])
    return np.repeat(number, mesh.order + 1), pairs.ravel(), coefficient.ravel()


def _extrapolate(number: int, arc_length: Real, length: float, end: int, pairs: Integer, mesh: Mesh) -> Terms:
    """Terms of an end without a tip element: pairs and their arc lengths from the tip on."""
    per_element = mesh.order + 1
    distance = length - arc_length if end else arc_length
    near = np.flatnonzero(distance < REACH * length)
    wanted = max(2 * per_element, near[-1] + 1 if len(near) else 0)
    chosen = np.arange(per_element, min(max(wanted, per_element + 2), len(pairs)))
    line = np.linalg.pinv(np.stack([np.ones(len(chosen)), distance[chosen]], axis=1))
    return np.full(len(chosen), number), pairs[chosen], line[0] / np.sqrt(distance[chosen])
