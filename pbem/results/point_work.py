"""What point loads work on: the displacement and the rotation at their points, but for what each of them makes itself.

The displacement at a point force grows like the logarithm of the distance, so that its own part is without bound, and
without bound the energy stored around it. Both are left out: the same on both sides of the energy balance. What remains
depends on where the logarithm is zero, for which the mesh must not count (`Model.self_energy_lengths`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pbem.arrays import Complex, Integer, Real
from pbem.bem.particular_solution import ParticularSolution
from pbem.bem.point_field import PointField
from pbem.mesh.interpolation import interpolate, locate_nodes
from pbem.mesh.mesh import Faces, Mesh
from pbem.model.model import Model
from pbem.model.point_loads import PointLoad


def measure_point_forces(model: Model, stage: int, factor: float) -> Real:
    """Force along x and y and moment of all point loads (3 c,)."""
    before = model.stages[stage - 1].point_forces if stage > 0 else {}
    after = model.stages[stage].point_forces
    start = np.array([before.get(name, (0.0, 0.0, 0.0)) for name in model.point_loads]).ravel()
    return np.asarray(start + factor * (np.array([after[name] for name in model.point_loads]).ravel() - start))


def measure_point_motions(
    model: Model, mesh: Mesh, faces: Faces, weight: Real, fields: tuple[Complex, Complex],
    particulars: list[tuple[ParticularSolution, ParticularSolution]],
) -> Real:
    """Displacement along x and y and rotation (3 c,) at all point loads, without what each makes itself (theory, 101).

    weight (f,), fields: displacement, without swelling, and traction (f,) on all faces. Inside, Betti's theorem between
    the elastic field and those of unit loads at the point; on a boundary, the value of the elements there.
    """
    numbers = {region.name: number for number, region in enumerate(model.regions)}
    moved = []
    for load in model.point_loads.values():
        number = numbers[load.region]
        balanced, far = particulars[number]
        unswollen = replace(balanced, swelling=ParticularSolution(balanced.material).swelling)
        own = np.flatnonzero(faces.region == number)
        z, n = faces.position[own], faces.normal[own]
        u, t = fields[0][own] - unswollen.displacement(z), fields[1][own] - unswollen.traction(z, n)
        others = replace(unswollen, points=tuple(each for each in balanced.points if each.load.name != load.name))
        # What a load makes itself is without bound, and left out up to one distance for all meshes and cracks.
        alone = sum(each.measure_shift(model.self_energy_lengths[load.region], balanced.material)
                    for each in balanced.points if each.load.name == load.name)
        shift = np.array([alone.real, alone.imag, 0.0])
        if load.on_boundary:
            at = _find_at_end(mesh, own, u, load.place)
            moved.append(shift + np.append(at + _evaluate_motion(others, load.place, model.size)[:2], 0.0))
            continue
        length = model.logarithm_lengths[load.region]
        units = [PointField(load, force, moment, length) for force, moment in ((1, 0.0), (1j, 0.0), (0j, 1.0))]
        unit_fields = [ParticularSolution(balanced.material, points=(unit,)) for unit in units]
        elastic = np.array([
            float(weight[own] @ (t * np.conj(unit.displacement(z)) - np.conj(unit.traction(z, n)) * u).real)
            for unit in unit_fields
        ])
        known = sum(_evaluate_motion(each, load.place, model.size) for each in (others, far))
        moved.append(shift + elastic + known)
    return np.concatenate(moved)


def evaluate_unit_motions(fields: list[ParticularSolution], center: complex, loads: list[PointLoad], size: float
                          ) -> Real:
    """Motions (fields, loads, 3) of some fields about a center at point loads."""
    return np.array([[_evaluate_motion(field, load.place - center, size) for load in loads] for field in fields])


def _evaluate_motion(field: ParticularSolution, place: complex, size: float) -> Real:
    """Displacement along x and y and rotation of a field at a place."""
    if field.is_zero:
        return np.zeros(3)
    h = 1e-4 * size
    points = place + h * np.array([0, 1, -1, 1j, -1j])
    u = field.displacement(points)
    rotation = 0.5 * ((u[1] - u[2]).imag - (u[3] - u[4]).real) / (2 * h)
    return np.array([u[0].real, u[0].imag, rotation])


def _find_at_end(mesh: Mesh, own: Integer, values: Complex, place: complex) -> Real:
    """The mean (2,) of what the two elements that end at a place have there; values (k,) at the nodes `own`."""
    region = mesh.region[own[0] // (mesh.order + 1)]
    beside = np.flatnonzero((mesh.region == region) & ~mesh.crack)
    ends = []
    for nearest, s in ((beside[np.argmin(np.abs(mesh.start[beside] - place))], -1.0),
                       (beside[np.argmin(np.abs(mesh.end[beside] - place))], 1.0)):
        nodes = nearest * (mesh.order + 1) + np.arange(mesh.order + 1)
        shapes = interpolate(locate_nodes(mesh)[nearest][None], np.array([[s]]))[0, 0]
        ends.append(complex(shapes @ values[np.searchsorted(own, nodes)]))
    mean = 0.5 * sum(ends)
    return np.array([mean.real, mean.imag])
