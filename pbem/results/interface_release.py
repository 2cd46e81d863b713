"""The J-integral where a crack along an interface ends and the bond begins: the energy released per length of growth.

Between two materials the field near such a tip oscillates, and there are no stress-intensity factors as in one material
(Williams, Bulletin of the Seismological Society of America 49, 1959); the energy released is defined all the same.
In each region J's path is an arc about the tip, and the region's boundary within it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pbem.arrays import Complex, Integer, Real
from pbem.bem.interior import InteriorRows
from pbem.bem.location import Location
from pbem.bem.particular_solution import ParticularSolution
from pbem.mesh.interpolation import differentiate, interpolate, split_faces
from pbem.mesh.mesh import Mesh
from pbem.mesh.numbering import list_nodes
from pbem.model.material import Material
from pbem.model.model import Model
from pbem.results.interface_tips import InterfaceTip, find_cut, find_interface_tips
from pbem.results.tip_field import place_gauss
from pbem.results.tip_shape import differentiate_at
from pbem.solve.problem.particular_solutions import evaluate_particular_solutions
from pbem.solve.problem.step import Step

ON_ARC = 32
ON_ELEMENT = 10
# Products of points and elements that may be evaluated in a step.
MOST_WORK = 1e7


@dataclass(frozen=True)
class InterfaceRelease:
    """Evaluates J at all tips of cracks along interfaces; too_many: they are more than can be evaluated.

    points (2 ON_ARC tips,): on the arcs, tip by tip and side by side; arcs: their angles from the direction of the tip,
    and half of what each spans.
    """

    model: Model
    mesh: Mesh
    tips: tuple[InterfaceTip, ...]
    points: Complex
    arcs: tuple[tuple[Real, float], ...]
    rows: InteriorRows | None

    @property
    def too_many(self) -> bool:
        return self.rows is None and len(self.tips) > 0

    def evaluate(self, step: Step) -> Real:
        """J (tips,), stress times length; NaN if there are too many.

        The closed path in each region is that of its elastic field, without body force and swelling. What the regions
        swell by, in whatever way, moves the faces against each other, but with them no singular stress: on the way to
        the tip their work vanishes.
        """
        J = np.full(len(self.tips), np.nan)
        if self.rows is None:
            return J
        particulars = evaluate_particular_solutions(self.model, step.stage, step.factor)
        moved, carried = self._take_off(step, [balanced for balanced, _ in particulars])
        inside = self.rows.evaluate(moved, carried)
        materials = [region.material for region in self.model.regions]
        for number, tip in enumerate(self.tips):
            J[number] = 0.0
            # The faces meet at the tip: displacements are those relative to it.
            tied = np.concatenate([chain[:1] for _, *both in tip.sides for chain in both])
            tied = tied[[self.mesh.curve_names[curve] != tip.name for curve in self.mesh.curve[tied]]]
            nodes = list_nodes(self.mesh, tied)
            nearest = nodes[np.argsort(np.abs(self.mesh.position[nodes] - tip.point))[: len(tied)]]
            rest = complex(split_faces(self.mesh, step.displacement)[0][nearest].mean())
            for side, (region, leaving, arriving) in enumerate(tip.sides):
                balanced, far = particulars[region]
                here = slice((2 * number + side) * ON_ARC, (2 * number + side + 1) * ON_ARC)
                displacement = inside.displacement[here] + far.displacement(self.points[here])
                stress = inside.stress[here] + far.stress(self.points[here])
                J[number] += _integrate_arc(tip, *self.arcs[2 * number + side], displacement, stress, materials[region])
                relative = moved - rest + complex(balanced.displacement(np.array([tip.point]))[0])
                for elements in (leaving, arriving):
                    J[number] += _integrate_boundary(self.mesh, tip, elements, relative, carried, materials[region])
        return J

    def _take_off(self, step: Step, balanced: list[ParticularSolution]) -> tuple[Complex, Complex]:
        """Displacement and traction (nodes,) of the field without body force, in the regions that have tips."""
        mesh = self.mesh
        first, opposite = split_faces(mesh, step.displacement)
        moved, carried = np.where(mesh.node_crack, first - opposite, first), step.traction[: mesh.nodes].copy()
        for region in sorted({side[0] for tip in self.tips for side in tip.sides}):
            if not balanced[region].is_zero:
                own = np.flatnonzero((mesh.node_region == region) & ~mesh.node_crack)
                moved[own] -= balanced[region].displacement(mesh.position[own])
                carried[own] -= balanced[region].traction(mesh.position[own], mesh.normal[own])
        return moved, carried


def _integrate_arc(
    tip: InterfaceTip, turn: Real, half: float, moved: Complex, stress: Real, material: Material
) -> float:
    """Of w n_x - t . du/dx on an arc; x is the tip's direction, turn (p,) the angles from it, half: half the arc's.

    (theory, 69)
    """
    points, weights = place_gauss(ON_ARC)
    normal = np.exp(1j * turn)
    local = moved * np.conj(tip.direction)
    sxx, syy, sxy = stress.T
    mean, deviator = 0.5 * (sxx + syy), (0.5 * (sxx - syy) + 1j * sxy) * np.conj(tip.direction) ** 2
    sxx, syy, sxy = mean + deviator.real, mean - deviator.real, deviator.imag
    modulus, lateral = material.plane_modulus, (3 - material.kappa) / (1 + material.kappa)
    exx, eyy = (sxx - lateral * syy) / modulus, (syy - lateral * sxx) / modulus
    exy = sxy / (2 * material.shear_modulus)
    tangent = 1j * normal
    strained = exx * tangent.real + exy * tangent.imag + 1j * (exy * tangent.real + eyy * tangent.imag)
    spread = differentiate_at(points) / (half * tip.radius)
    rotation = -(np.conj(normal) * (spread @ (local - local.mean()) - strained)).real
    along_x = exx + 1j * (exy + rotation)
    carried = sxx * normal.real + sxy * normal.imag + 1j * (sxy * normal.real + syy * normal.imag)
    energy = 0.5 * (sxx * exx + syy * eyy + 2 * sxy * exy)
    return float(half * tip.radius * weights @ (energy * normal.real - (np.conj(carried) * along_x).real))


def _integrate_boundary(
    mesh: Mesh, tip: InterfaceTip, elements: Integer, displacement: Complex, traction: Complex, material: Material
) -> float:
    """Of w n_x - t . du/dx on the elements within the circle, from their displacements and tractions (theory, 69).

    Where the interface is not bonded the displacement grows like a root, which is right only in the mean: there the
    tangential derivative is integrated by parts. The faces meet at the tip, so that it has no part in the sum of both.
    """
    modulus, lateral = material.plane_modulus, (3 - material.kappa) / (1 + material.kappa)
    shear_modulus = material.shear_modulus
    by_parts = mesh.curve_names[mesh.curve[elements[0]]] == tip.name
    total, work, before = 0.0, 0.0, (0j, 0j)
    for element in elements.tolist():
        ends = np.abs(np.array([mesh.start[element], mesh.end[element]]) - tip.point)
        if ends.min() >= tip.radius:
            break
        forward = ends[0] < ends[1]
        cut = find_cut(mesh, tip, element, tip.radius) if ends.max() > tip.radius else (1.0 if forward else -1.0)
        near = -1.0 if forward else 1.0
        here = _BoundaryPart(mesh, tip, element, min(near, cut), max(near, cut), displacement, traction)
        strain = (np.conj(here.tangent) * here.along).real
        t_n, t_e = (np.conj(here.normal) * here.carried).real, (np.conj(here.tangent) * here.carried).real
        strain_n = (1 - lateral**2) * t_n / modulus - lateral * strain
        # The derivative along the normal: its tangential part from the shear strain, 2 e = t_e/G.
        turned = t_e / shear_modulus - (np.conj(here.normal) * here.along).real
        outward = strain_n * here.normal + turned * here.tangent
        energy = 0.5 * (modulus * strain**2 + (1 - lateral**2) * t_n**2 / modulus + t_e**2 / shear_modulus)
        values = energy * here.normal.real - (np.conj(here.carried) * outward).real * here.normal.real
        if not by_parts:
            values = values - (np.conj(here.carried) * here.along).real * here.tangent.real
        total += float(here.weight @ values)
        if by_parts:
            g, u = here.at(near)
            work -= _scalar(g - before[0], 0.5 * (u + before[1])) if before != (0j, 0j) else 0.0
            work -= here.integrate_slope() * (1 if forward else -1)
            before = here.at(cut)
        if ends.max() > tip.radius:
            break
    work += _scalar(*before)
    first = elements[0]
    outwards = abs(mesh.start[first] - tip.point) < abs(mesh.end[first] - tip.point)
    return total - (work if outwards else -work)


def _scalar(first: complex, second: complex) -> float:
    return (np.conj(first) * second).real


class _BoundaryPart:
    """A part of an element in the frame of the tip: at points (p,), from the values at its nodes."""

    def __init__(
        self, mesh: Mesh, tip: InterfaceTip, element: int, low: float, high: float, displacement: Complex,
        traction: Complex,
    ) -> None:
        points, weights = place_gauss(ON_ELEMENT)
        self._local = mesh.local[None]
        self._one = mesh.geometry.select([element])
        nodes = element * (mesh.order + 1) + np.arange(mesh.order + 1)
        self._direction = tip.direction
        self._u, self._t = (values[nodes] * np.conj(tip.direction) for values in (displacement, traction))
        self._s = 0.5 * (low + high) + 0.5 * (high - low) * points
        self._by_s = 0.5 * (high - low) * weights
        stretch = self._one.stretch(self._s)[0]
        self.weight = self._by_s * stretch
        self.normal = self._one.normals(self._s)[0] * np.conj(tip.direction)
        self.tangent = 1j * self.normal
        self.along = differentiate(self._local, self._s[None])[0] @ self._u / stretch
        self.carried = interpolate(self._local, self._s[None])[0] @ self._t

    def at(self, s: float) -> tuple[complex, complex]:
        """What is integrated against du, the traction times the cosine of the tangent; and u."""
        shapes = interpolate(self._local, np.array([[s]]))[0, 0]
        tangent = 1j * self._one.normals(np.array([s]))[0, 0] * np.conj(self._direction)
        return complex(shapes @ self._t) * tangent.real, complex(shapes @ self._u)

    def integrate_slope(self) -> float:
        """Of the derivative of that times u over the part, in the direction of travel."""
        slope = differentiate(self._local, self._s[None])[0] @ self._t * self.tangent.real
        turning = (1j * self.tangent).real * self._one.curvature(self._s)[0] * self.weight / self._by_s
        moved = interpolate(self._local, self._s[None])[0] @ self._u
        return float(self._by_s @ (np.conj(slope + self.carried * turning) * moved).real)


def prepare_interface_release(model: Model, mesh: Mesh) -> InterfaceRelease:
    """The tips of all cracks along interfaces, and the rows that J is evaluated with."""
    tips = find_interface_tips(model, mesh)
    if not tips:
        return InterfaceRelease(model, mesh, (), np.zeros(0, dtype=complex), (), None)
    points, arcs = place_gauss(ON_ARC)[0], []
    places, regions = [], []
    for tip in tips:
        for region, leaving, arriving in tip.sides:
            begin, end = (np.angle((_cross(mesh, tip, chain) - tip.point) * np.conj(tip.direction))
                          for chain in (leaving, arriving))
            half = 0.5 * float((end - begin) % (2 * np.pi))
            turn = begin + half * (1 + points)
            arcs.append((turn, half))
            places.append(tip.point + tip.radius * tip.direction * np.exp(1j * turn))
            regions.append(np.full(ON_ARC, region))
    region = np.concatenate(regions)
    place = np.concatenate(places)
    work = np.bincount(mesh.region, minlength=len(model.regions))[region].sum()
    if work > MOST_WORK:
        return InterfaceRelease(model, mesh, tips, place, tuple(arcs), None)
    nowhere = np.full(len(region), -1)
    materials = [each.material for each in model.regions]
    rows = InteriorRows(mesh, materials, place, Location(region, nowhere, np.zeros(len(region))))
    return InterfaceRelease(model, mesh, tips, place, tuple(arcs), rows)


def _cross(mesh: Mesh, tip: InterfaceTip, chain: Integer) -> complex:
    for element in chain.tolist():
        if max(abs(mesh.start[element] - tip.point), abs(mesh.end[element] - tip.point)) > tip.radius:
            one = mesh.geometry.select([element])
            return complex(one.place(np.array([find_cut(mesh, tip, element, tip.radius)]))[0, 0])
    raise AssertionError("the circle is smaller than the boundary that it cuts")
