"""Hoop stress, the normal stress along the boundary, at the nodes of all faces: from the stretch and Hooke's law."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pbem.arrays import Complex, Integer, Real
from pbem.bem.particular_solution import ParticularSolution
from pbem.mesh.interpolation import differentiate_at_nodes, differentiate_tips, locate_nodes, split_faces
from pbem.mesh.mesh import Mesh, second_face_nodes

# Directions that differ by less (radians) are one: rounding of places far from the origin.
SMOOTH = 1e-6
# Elements whose derivatives are formed at a time; of meshes of no more what these take is kept.
AT_A_TIME = 1024
# Faces whose stress is evaluated at a time.
EVALUATED = 4096


def evaluate_hoop_stress(
    mesh: Mesh, initial: Sequence[ParticularSolution], displacement: Complex, traction: Complex
) -> Real:
    """Normal stress along the boundary (f,) at the nodes of `list_faces(mesh)` (theory, 71).

    displacement, traction (f,) complex, at these nodes. initial: per region its material, its in-situ stress, which has
    no displacement, and its swelling, which has no stress. The stretch is the derivative of the polynomial through an
    element's own nodes and the nearest one of each neighbour on a smooth curve: the own polynomial alone is off by
    several times as much at its outer nodes. On a crack's faces it is that of their mean displacement, and plus or
    minus half that of the jump, which at a tip has the square-root shape: the hoop stress then grows like
    1/sqrt(distance) in mode II, as it should; jumps keep to their own element. Elements of order 0 have no stretch of
    their own: there it is the difference between neighbours on the same curve, up to its corners.
    """
    of_points = sample_points(mesh, initial)
    if of_points is not None:  # what is singular at a point is no polynomial
        rest = evaluate_hoop_stress(
            mesh, [replace(each, points=()) for each in initial], displacement - of_points.displacement,
            traction - of_points.traction,
        )
        return rest + of_points.hoop_stress
    stress = np.concatenate([each.real for each in measure_gradients(mesh, displacement)])
    node = np.concatenate([np.arange(mesh.nodes), second_face_nodes(mesh)])
    region = mesh.node_region[node]
    order = np.argsort(region, kind="stable")
    bounds = np.searchsorted(region[order], np.arange(len(initial) + 1))
    for number, particular in enumerate(initial):
        at_rest = ParticularSolution(particular.material, initial=particular.initial)
        kappa = particular.material.kappa
        lateral = (3 - kappa) / (1 + kappa)  # Poisson's ratio of the plane problem
        for begin in range(bounds[number], bounds[number + 1], EVALUATED):
            own = order[begin : min(begin + EVALUATED, bounds[number + 1])]
            position, e = mesh.position[node[own]], 1j * mesh.normal[node[own]]
            n = -1j * e * np.where(own < mesh.nodes, 1.0, -1.0)
            rest_n = (np.conj(n) * at_rest.traction(position, n)).real
            rest_s = (np.conj(e) * at_rest.traction(position, e)).real
            elastic = stress[own] - particular.swelling.strain_along(position, e)
            pressed = (np.conj(n) * traction[own]).real - rest_n
            stress[own] = rest_s + particular.material.plane_modulus * elastic + lateral * pressed
    return stress


def measure_gradients(mesh: Mesh, displacement: Complex) -> tuple[Complex, Complex]:
    """The stretch of faces along themselves, and by the imaginary part what they turn by (radians): of the nodes
    (nodes,), and of the second faces of cracks behind these in `list_faces(mesh)`; displacement (f,)."""
    mean, half_jump = differentiate_faces(mesh, displacement)
    back = np.conj(1j * mesh.normal)
    return back * (mean + half_jump), (back * (mean - half_jump))[second_face_nodes(mesh)]


@dataclass(frozen=True)
class PointFields:
    """What the fields of point loads have at the nodes (f,) of `list_faces(mesh)`: displacement and traction (complex),
    and the normal stress along the boundary."""

    displacement: Complex
    traction: Complex
    hoop_stress: Real


def sample_points(mesh: Mesh, particulars: Sequence[ParticularSolution]) -> PointFields | None:
    """The fields of the regions' point loads on all faces; None if there are none."""
    if not any(each.points for each in particulars):
        return None
    second = second_face_nodes(mesh)
    region = np.concatenate([mesh.node_region, mesh.node_region[second]])
    position = np.concatenate([mesh.position, mesh.position[second]])
    normal = np.concatenate([mesh.normal, -mesh.normal[second]])
    moved, carried, along = np.zeros(len(region), complex), np.zeros(len(region), complex), np.zeros(len(region))
    for number, particular in enumerate(particulars):
        own = np.flatnonzero(region == number)
        if particular.points and len(own):
            fields, n = particular.of_points, normal[own]
            moved[own] = fields.displacement(position[own])
            carried[own] = fields.traction(position[own], n)
            along[own] = (np.conj(1j * n) * fields.traction(position[own], 1j * n)).real
    return PointFields(moved, carried, along)


def evaluate_stretch(mesh: Mesh, displacement: Complex) -> tuple[Complex, Complex]:
    """Derivative of the displacement (f,) along the faces at the nodes of `list_faces(mesh)`, and the directions.

    Both are taken along the mesh's elements, so that those of second faces are against their travel.
    """
    second = second_face_nodes(mesh)
    mean, half_jump = differentiate_faces(mesh, displacement)
    along = 1j * mesh.normal
    stretch = np.concatenate([mean + half_jump, (mean - half_jump)[second]])
    return stretch, np.concatenate([along, along[second]])


def differentiate_faces(mesh: Mesh, displacement: Complex) -> tuple[Complex, Complex]:
    """Derivatives (nodes,) by the length in the direction of travel, of the mean of the displacements (f,) of both
    faces and of half of the first's less the second's; where there is one face alone, of its own and nothing."""
    first, opposite = split_faces(mesh, displacement)
    mean, half_jump = 0.5 * (first + opposite), 0.5 * (first - opposite)
    if mesh.order == 0:
        return _difference_neighbours(mesh, mean), _difference_neighbours(mesh, half_jump)
    nodal = [each.reshape(mesh.elements, -1) for each in (mean, half_jump)]
    found = [np.empty_like(each) for each in nodal]
    for shapes in _list_shapes(mesh):
        found[0][shapes.own] = shapes.differentiate(nodal[0])
        found[1][shapes.own] = shapes.differentiate_jumps(nodal[1])
    return found[0].ravel(), found[1].ravel()


@dataclass(frozen=True)
class _Shapes:
    """What derivatives of nodal values along elements own (e,) of a mesh take.

    plain, of_jumps (e, p + 1, p + 1): derivatives by s at the nodes, of the element's polynomials, with the square-root
    shape at tips for jumps; stretch (e, p + 1): length by s. patches (3, k): numbers of elements that go on smoothly
    at both ends, between those before and after them; place (k,): of these among the own; of_patches
    (k, p + 1, p + 3): derivatives there, by the length over that of the element (k,), of the polynomials through the
    own nodes and the nearest of each neighbour.
    """

    own: Integer
    plain: Real
    of_jumps: Real
    stretch: Real
    patches: Integer
    place: Integer
    of_patches: Real
    lengths: Real

    def differentiate(self, nodal: Complex) -> Complex:
        """Derivatives (e, p + 1) by the length for values at the nodes of all elements of the mesh."""
        derivative: Complex = np.einsum("epj,ej->ep", self.plain, nodal[self.own]) / self.stretch
        former, inner, latter = self.patches
        known = np.concatenate([nodal[former, -1:], nodal[inner], nodal[latter, :1]], axis=1)
        derivative[self.place] = np.einsum("epj,ej->ep", self.of_patches, known) / self.lengths[:, None]
        return derivative

    def differentiate_jumps(self, nodal: Complex) -> Complex:
        """The same of jumps, with the shape of those at tips."""
        return np.asarray(np.einsum("epj,ej->ep", self.of_jumps, nodal[self.own]) / self.stretch)


def _list_shapes(mesh: Mesh) -> Iterator[_Shapes]:
    """Those of all elements; of large meshes some elements at a time, as they take more room than the mesh itself."""
    if mesh.elements <= AT_A_TIME:
        yield mesh.keep("derivatives", lambda mesh: _derive_shapes(
            mesh, np.arange(mesh.elements), _find_smooth_joints(mesh)))
        return
    following = _find_smooth_joints(mesh)
    for begin in range(0, mesh.elements, AT_A_TIME):
        yield _derive_shapes(mesh, np.arange(begin, min(begin + AT_A_TIME, mesh.elements)), following)


def _derive_shapes(mesh: Mesh, own: Integer, following: Integer) -> _Shapes:
    """Those of some elements, rising; following (elements,): see `_find_smooth_joints`."""
    local, tip = locate_nodes(mesh, own), mesh.tip[own]
    plain = of_jumps = differentiate_at_nodes(local)
    tips = np.flatnonzero(tip)
    if len(tips):
        of_jumps = plain.copy()
        of_jumps[tips] = differentiate_tips(tip[tips], local[tips], local[tips])
    before = np.full(mesh.elements, -1)
    before[following[following >= 0]] = np.flatnonzero(following >= 0)
    place = np.flatnonzero((following[own] >= 0) & (before[own] >= 0))
    inner = own[place]
    former, latter = before[inner], following[inner]

    def measure_along(numbers: Integer) -> tuple[Real, Real]:
        """Lengths of elements (k, 1), and those from their starts to their nodes."""
        some = mesh.geometry.select(numbers)
        length = some.lengths[:, None]
        return length, some.fractions(locate_nodes(mesh, numbers)) * length

    (length_before, along_before), (length, along) = measure_along(former), measure_along(inner)
    places = np.concatenate([along_before[:, -1:] - length_before, along,
                             measure_along(latter)[1][:, :1] + length], axis=1) / length
    return _Shapes(own, plain, of_jumps, mesh.geometry.select(own).stretch(local), np.stack([former, inner, latter]),
                   place, differentiate_at_nodes(places)[:, 1:-1], length[:, 0])


def _find_smooth_joints(mesh: Mesh) -> Integer:
    """For each element (e,) the one in which it goes on, on the same curve without a corner; -1 where it does not."""
    numbers = np.arange(mesh.elements)
    key = np.stack([mesh.curve, mesh.region, mesh.crack])
    begin, end = (each / np.abs(each) for each in mesh.geometry.directions())
    breaks = (np.diff(key, axis=1) != 0).any(axis=0) | (mesh.start[1:] != mesh.end[:-1])
    # The other side of a closed curve may begin where the first ends, and turns back there.
    breaks |= (np.conj(end[:-1]) * begin[1:]).real < 0
    firsts = np.concatenate([[0], np.flatnonzero(breaks) + 1])
    following = numbers + 1
    following[np.concatenate([firsts[1:] - 1, [mesh.elements - 1]])] = firsts  # closed curves go on where they began
    turns = mesh.geometry.turns
    smooth = (mesh.start[following] == mesh.end) & (following != numbers)
    smooth &= (np.abs(end - begin[following]) < SMOOTH) & (turns[following] * turns >= 0)
    return np.where(smooth, following, -1)


def _difference_neighbours(mesh: Mesh, values: Complex) -> Complex:
    """Differences along chains of elements that go on smoothly, of second order inside of them; an element that is
    alone between two corners has those to its neighbours on the same curve."""
    connected = (mesh.start[1:] == mesh.end[:-1]) & (mesh.region[1:] == mesh.region[:-1])
    connected &= mesh.curve[1:] == mesh.curve[:-1]
    length = mesh.geometry.lengths
    result = np.zeros_like(values)
    for chain in np.split(np.arange(mesh.elements), np.flatnonzero(~connected) + 1):
        if len(chain) > 1:
            result[chain] = _difference_chain(length[chain], values[chain])
    for chain, closed in _chain_up(_find_smooth_joints(mesh)):
        if closed:
            around = np.concatenate([chain[-1:], chain, chain[:1]])
            result[chain] = _difference_chain(length[around], values[around])[1:-1]
        elif len(chain) > 1:
            result[chain] = _difference_chain(length[chain], values[chain])
    return result


def _difference_chain(length: Real, values: Complex) -> Complex:
    """Derivatives at the middles of elements in a row, two at least: of parabolas through three, outside of straight
    lines."""
    return np.asarray(np.gradient(values, np.cumsum(length) - 0.5 * length))


def _chain_up(following: Integer) -> list[tuple[Integer, bool]]:
    """Chains of elements that follow each other, and whether the last one is followed by the first. following (e,): the
    next one of each, or -1."""
    first = np.ones(len(following), dtype=bool)
    first[following[following >= 0]] = False
    seen = np.zeros(len(following), dtype=bool)
    chains = []
    for begin in np.concatenate([np.flatnonzero(first), np.arange(len(following))]):
        chain, at = [], int(begin)
        while at >= 0 and not seen[at]:
            seen[at] = True
            chain.append(at)
            at = int(following[at])
        if chain:
            chains.append((np.array(chain), at == begin))
    return chains
