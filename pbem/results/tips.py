"""Stress-intensity factors at the tips of cracks, from the square root in which the jump of displacement begins."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbem.contact.laws import collect_laws
from pbem.mesh.interpolation import locate_nodes
from pbem.mesh.mesh import Mesh
from pbem.mesh.shapes import interpolate_shapes
from pbem.model.model import Model
from pbem.solve.step import ContactState

Real = NDArray[np.float64]
Integer = NDArray[np.int64]

# Without tip elements: the part of the crack's length next to the tip whose jumps are looked at.
REACH = 0.1


@dataclass(frozen=True)
class TipRule:
    """K = sum over pairs (k,) of coefficient (stress/sqrt(length)) times the jump there, for each of its components."""

    pairs: Integer
    coefficient: Real


@dataclass(frozen=True)
class TipRules:
    """The rules of both ends of every crack (None at an end that is no tip), and the initial gap (m,) of all pairs."""

    rules: Mapping[str, tuple[TipRule | None, TipRule | None]]
    gap: Real

    def evaluate(self, contact: ContactState) -> dict[str, tuple[Real, Real]]:
        """KI and KII (2,) of every crack at its start and its end, stress times sqrt(length); NaN where no tip is.

        KI > 0 opens; KII > 0 if the face on the left of the crack's direction moves along it, at both ends. Where no
        pair of the tip's element is open or has an elastic joint, KI is exactly zero.
        """
        opening = contact.opening - self.gap
        factors = {}
        for name, ends in self.rules.items():
            found = np.full((2, 2), np.nan)
            for end, rule in enumerate(ends):
                if rule is not None:
                    found[:, end] = rule.coefficient @ opening[rule.pairs], -rule.coefficient @ contact.slip[rule.pairs]
            factors[name] = (found[0] + 0.0, found[1] + 0.0)  # no negative zeros
        return factors


def collect_tip_rules(model: Model, mesh: Mesh) -> TipRules:
    """How the factors follow from the jumps at the pairs.

    Near a tip the jump is (8/E') K sqrt(rho/(2 pi)), rho being the distance from the tip along the crack. On a tip
    element its components along the normal and the crack are sums of t^(k + 1/2), and rho tends to t times the distance
    of the element's ends, on arcs too (the derivative of the arc length by t at the tip is the chord). Without tip
    elements the jump over sqrt(rho) is extrapolated linearly to the tip from its neighbourhood, the last element left
    out, which cannot follow the root.
    """
    rules = {
        region_crack: (
            _make_rule(model, mesh, region_crack, 0, region.material.plane_modulus),
            _make_rule(model, mesh, region_crack, 1, region.material.plane_modulus),
        )
        for region in model.regions
        for region_crack in region.cracks
    }
    return TipRules({name: rules[name] for name in model.crack_tips}, collect_laws(model, mesh).gap)


def _make_rule(model: Model, mesh: Mesh, crack: str, end: int, plane_modulus: float) -> TipRule | None:
    if not model.crack_tips[crack][end]:
        return None
    pairs = np.flatnonzero(mesh.pairs.interface == mesh.interface_names.index(crack))
    pairs = pairs[np.argsort(mesh.pairs.arc_length[pairs])]
    pairs = pairs[::-1] if end else pairs  # from the tip on
    per_element = mesh.order + 1
    element = int(mesh.node_element[mesh.pairs.first[pairs[0]]])
    if mesh.tip[element] == end + 1 or len(pairs) == per_element:
        own = pairs[:per_element]
        s = locate_nodes(mesh)[element]
        t = 0.5 * (1 + s) if end == 0 else 0.5 * (1 - s[::-1])
        per_root_length = interpolate_shapes(t, 0.5)[0] / np.sqrt(abs(mesh.end[element] - mesh.start[element]))
    else:
        length = model.curves[crack].length
        along = mesh.pairs.arc_length[pairs]
        distance = length - along if end else along
        near = np.flatnonzero(distance < REACH * length)
        wanted = max(2 * per_element, near[-1] + 1 if len(near) else 0)
        chosen = np.arange(per_element, min(max(wanted, per_element + 2), len(pairs)))
        own = pairs[chosen]
        line = np.linalg.pinv(np.stack([np.ones(len(chosen)), distance[chosen]], axis=1))
        per_root_length = line[0] / np.sqrt(distance[chosen])
    return TipRule(own, plane_modulus / 8 * np.sqrt(2 * np.pi) * per_root_length)
