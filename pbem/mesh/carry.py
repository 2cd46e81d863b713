"""Values from one mesh at the nodes of another, each of whose elements is made of whole elements of the first."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from pbem.arrays import Complex, Integer, Real
from pbem.geometry.curve import Curve
from pbem.mesh.interpolation import interpolate, interpolate_tips, locate_nodes
from pbem.mesh.mesh import Mesh
from pbem.model.model import Model
from pbem.model.refinement import group_elements

# Nodes this far beyond an element's end, in half-lengths, still lie on it: rounding of places far from the origin.
BEYOND = 1e-2
# Nodes that lie no farther than this, in half-lengths, from where two elements meet are on the first one along the
# curve: the middles of merged pairs, which rounding must not give to the one or the other.
MEETING = 1e-6


@dataclass(frozen=True)
class Carry:
    """What takes values at the fine mesh's nodes (n,) to the coarse mesh's nodes (c,).

    plain (c, n): by the polynomials of the fine elements; rooted (c, n): for jumps, which follow the root of the
    distance from each tip of a crack: with the square-root shape on crack-tip elements, on the others of the crack by
    polynomials times these roots. nearest (c,): the fine node nearest to each coarse node on its element.
    """

    plain: sparse.csr_matrix
    rooted: sparse.csr_matrix
    nearest: Integer


def list_curve_elements(model: Model, mesh: Mesh) -> list[tuple[str, Integer]]:
    """The mesh's elements chain by chain, each in the direction of its curve: the curve's name, and their numbers."""
    chains = []
    key = np.stack([mesh.region, mesh.curve, mesh.crack])
    borders = np.flatnonzero((np.diff(key, axis=1) != 0).any(axis=0)) + 1
    for chain in np.split(np.arange(mesh.elements), borders):
        name = mesh.curve_names[mesh.curve[chain[0]]]
        forward = _goes_forward(model.curves[name], mesh.start[chain[0]], mesh.end[chain[0]])
        chains.append((name, chain if forward else chain[::-1]))
    return chains


def _goes_forward(curve: Curve, start: complex, end: complex) -> bool:
    """Whether elements of a curve, of which the first one has these ends, go in its direction."""
    if not curve.closed and start in (curve.start, curve.end):
        return bool(start == curve.start)
    # The first element of a closed curve, or its last one travelled backwards, starts where the curve does.
    after, before = curve.legs[0].element_ends()[1], curve.legs[-1].element_ends()[-2]
    return bool(abs(end - after) <= abs(end - before))


def carry_nodes(fine_model: Model, fine: Mesh, coarse_model: Model, coarse: Mesh) -> Carry:
    """How values on the fine mesh are read at the nodes of the coarse one (see `pbem.model.refinement`)."""
    groups = {name: group_elements(curve, coarse_model.curves[name]) for name, curve in fine_model.curves.items()}
    element = np.empty((coarse.elements, coarse.order + 1), dtype=np.int64)
    local = np.full((coarse.elements, coarse.order + 1), np.inf)
    points = coarse.position.reshape(coarse.elements, -1)
    chains = zip(list_curve_elements(fine_model, fine), list_curve_elements(coarse_model, coarse), strict=True)
    # Coarse elements are made of the fine ones from a first one along their curve on, to one before a last one.
    along, begin, end, target = [], [], [], []
    placed = 0
    for (name, own), (_, others) in chains:
        along.append(own)
        begin.append(placed + groups[name][:-1])
        end.append(placed + groups[name][1:])
        target.append(others)
        placed += len(own)
    sources, first, last, targets = (np.concatenate(each) for each in (along, begin, end, target))
    for offset in range(int((last - first).max())):
        at = np.flatnonzero(first + offset < last)
        source, found = sources[first[at] + offset], targets[at]
        s = fine.geometry.select(source).preimage(points[found]).real
        better = np.abs(s) < np.abs(local[found]) - MEETING
        local[found] = np.where(better, s, local[found])
        element[found] = np.where(better, source[:, None], element[found])
    assert (np.abs(local) <= 1 + BEYOND).all()
    return _build_carry(fine, element.ravel(), local.ravel(), coarse.position, _RootOfTips(fine_model, fine))


class _RootOfTips:
    """The product of the roots of the distances from the tips of a crack, along it; 1 on other curves."""

    def __init__(self, model: Model, mesh: Mesh) -> None:
        # Of each element: the end that comes first along the curve, its distance along it, and whether there are tips.
        self._begin, self._along = np.zeros(mesh.elements, dtype=complex), np.zeros(mesh.elements)
        self._whole, self._tips = np.ones(mesh.elements), np.zeros((2, mesh.elements), dtype=bool)
        length = mesh.weight.reshape(mesh.elements, -1).sum(axis=1)
        for name, chain in list_curve_elements(model, mesh):
            if not any(model.crack_tips.get(name, (False, False))):
                continue
            forward = np.abs(mesh.start[chain[0]] - model.curves[name].start) <= 0.5 * length[chain[0]]
            self._begin[chain] = (mesh.start if forward else mesh.end)[chain]
            self._along[chain] = np.concatenate([[0.0], np.cumsum(length[chain])[:-1]])
            self._whole[chain] = length[chain].sum()
            self._tips[:, chain] = np.array(model.crack_tips[name])[:, None]

    def evaluate(self, element: Integer, points: Complex) -> Real:
        """At points (k,) on the elements (k,)."""
        along = (self._along[element] + np.abs(points - self._begin[element])) / self._whole[element]
        from_start = np.where(self._tips[0, element], along, 1.0)
        from_end = np.where(self._tips[1, element], 1.0 - along, 1.0)
        return np.asarray(np.sqrt(np.maximum(from_start * from_end, 0.0)))


def _build_carry(fine: Mesh, element: Integer, s: Real, points: Complex, root: _RootOfTips) -> Carry:
    per_element = fine.order + 1
    nodes = element[:, None] * per_element + np.arange(per_element)
    places = locate_nodes(fine)[element]
    plain = interpolate(places, s[:, None])[:, 0]
    own = root.evaluate(np.arange(fine.nodes) // per_element, fine.position)
    rooted = plain * (root.evaluate(element, points)[:, None] / own[nodes])
    tips = np.flatnonzero(fine.tip[element] > 0)
    if len(tips):
        inside = np.clip(s[tips], -1.0, 1.0)[:, None]
        rooted[tips] = interpolate_tips(fine.tip[element[tips]], places[tips], inside)[:, 0]
    rows = np.repeat(np.arange(len(s)), per_element)

    def build(values: Real) -> sparse.csr_matrix:
        return sparse.csr_matrix((values.ravel(), (rows, nodes.ravel())), shape=(len(s), fine.nodes))

    nearest = nodes[np.arange(len(s)), np.argmin(np.abs(places - s[:, None]), axis=1)]
    return Carry(build(plain), build(rooted), nearest)
