"""How far a step is from what the equations suppose: small strains, small rotations, faces that hardly slide."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pbem.arrays import Complex, Integer, Real
from pbem.bem.hoop import measure_gradients
from pbem.geometry.tolerance import TIE
from pbem.mesh.mesh import Mesh, second_face_nodes
from pbem.solve.problem.step import Linearity

# Strains and rotations (radians) beyond which linear theory no longer holds.
LARGEST_STRAIN = 0.1
# Strains are singular at corners and tips: what counts is exceeded on this part of a region's boundary.
EXCEEDED_ON = 0.01


def measure_linearity(mesh: Mesh, displacement: Complex, slip: Real) -> Linearity:
    """Of the displacement (f,) at the nodes of `list_faces(mesh)` and the slip (m,) of all pairs."""
    # On every rank beside its matrices: no more at a time than has to be.
    gradients = measure_gradients(mesh, displacement)
    stretched = np.concatenate([np.abs(each.real) for each in gradients])
    turned = np.concatenate([np.abs(each.imag) for each in gradients])
    del gradients
    count, second = len(mesh.region_names), second_face_nodes(mesh)
    region = np.concatenate([mesh.node_region, mesh.node_region[second]])
    length = np.concatenate([mesh.weight, mesh.weight[second]])
    strain, rotation = (_find_exceeded(each, region, length, count) for each in (stretched, turned))
    pairs, interfaces = mesh.pairs, len(mesh.interface_names)
    weight = np.where(pairs.crack, mesh.weight[pairs.first], pairs.weight)
    elements = np.maximum(np.bincount(pairs.interface, minlength=interfaces) / (mesh.order + 1), 1.0)
    length = np.bincount(pairs.interface, weight, interfaces) / elements
    largest = np.zeros(interfaces)
    np.maximum.at(largest, pairs.interface, np.abs(slip))
    relative = np.divide(largest, length, out=np.zeros(interfaces), where=length > 0)
    return Linearity(strain, rotation, relative)


def _find_exceeded(values: Real, region: Integer, weight: Real, regions: int) -> Real:
    """Per region the value that is exceeded on the part EXCEEDED_ON of its boundary; 0 where there is none."""
    order = np.lexsort((-values, region))
    length = np.bincount(region, weight, regions)
    before = np.concatenate([[0.0], np.cumsum(length)])[:-1]
    first = np.searchsorted(region[order], np.arange(regions + 1))
    at = np.searchsorted(np.cumsum(weight[order]), before + EXCEEDED_ON * length)
    at = np.clip(at, first[:-1], np.maximum(first[1:] - 1, first[:-1]))
    there = first[1:] > first[:-1]
    result = np.zeros(regions)
    result[there] = values[order[at[there]]]
    return result


def measure_excess(linearity: Linearity) -> float:
    """How many times the largest of strains, rotations and slips is what linear theory is for."""
    parts = [linearity.strain / LARGEST_STRAIN, linearity.rotation / LARGEST_STRAIN, linearity.slip]
    return max(float(part.max(initial=0.0)) for part in parts)


def describe_nonlinearity(regions: Sequence[str], interfaces: Sequence[str], linearity: Linearity) -> list[str]:
    """What of a step is beyond linear theory, a sentence each; nothing where it holds."""
    worst = [(linearity.strain, "strains", ""), (linearity.rotation, "rotations", " radians")]
    notes = []
    for values, what, unit in worst:
        largest = _find_worst(values)
        if values[largest] > LARGEST_STRAIN:
            notes.append(
                f"{what} of {values[largest]:.2g}{unit} on region '{regions[largest]}' are beyond linear "
                f"theory, which is for less than {LARGEST_STRAIN:g}"
            )
    if len(linearity.slip) and linearity.slip.max() > 1:
        largest = _find_worst(linearity.slip)
        notes.append(
            f"faces of '{interfaces[largest]}' slip by {linearity.slip[largest]:.2g} times the mean length of "
            "their elements, but the equations still use the initial pairs"
        )
    return notes


def _find_worst(values: Real) -> int:
    """The number of the largest, of those that symmetry makes equal the first: their rounding must not choose."""
    known = np.nan_to_num(values)
    return int(np.flatnonzero(known >= (1 - TIE) * known.max())[0])
