"""Rigid motions that neither the conditions nor the interfaces of a model prevent."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pbem.case.finding import list_names
from pbem.model.intersection import inner_points
from pbem.model.junction import format_point
from pbem.model.loop import side_legs
from pbem.model.model import Law, Loop, Model, Side

Tie = Literal["both", "normal", "none"]

# A motion is free if it violates the constraints by less than this part of their size.
RELATIVE_RANK = 1e-8


@dataclass(frozen=True)
class FreeMotion:
    """A rigid motion that nothing prevents.

    regions: names of the regions that move; velocities: for each of them (a, w): a point z moves by a + i w z
    (a complex, w real; both up to one common factor); text: the motion in words.
    """

    regions: tuple[str, ...]
    velocities: Mapping[str, tuple[complex, float]]
    text: str


def default_tie(law: Law) -> Tie:
    """What an interface holds before anything is computed: faces that touch are taken to press on each other."""
    if law.kind == "bonded":
        return "both"
    if law.kind == "open" or law.gap > 0:
        return "none"
    return "both" if law.friction > 0 or law.cohesion > 0 else "normal"


def find_free_motions(model: Model, ties: Mapping[str, Tie] | None = None) -> tuple[FreeMotion, ...]:
    """A basis of the rigid motions of the regions that no prescribed displacement and no interface prevents.

    ties: interface name to what it holds: "both" relative displacements, the "normal" one, or "none"; interfaces that
    are not named hold what their law gives (`default_tie`).
    """
    held = {name: default_tie(interface.law) for name, interface in model.interfaces.items()} | dict(ties or {})
    names = [region.name for region in model.regions]
    center, scale = _frame(model)
    rows = _boundary_rows(model, names, center, scale) + _interface_rows(model, names, held, center, scale)
    matrix = np.concatenate([np.zeros((1, 3 * len(names))), *rows])
    singular, right = np.linalg.svd(np.linalg.qr(matrix, mode="r"), full_matrices=True)[1:]
    rank = int(np.sum(singular > RELATIVE_RANK * max(1.0, singular[0])))
    return tuple(_describe(vector, names, center, scale) for vector in _sparse_basis(right[rank:]))


def _frame(model: Model) -> tuple[complex, float]:
    points = np.array([leg.start for curve in model.curves.values() for leg in curve.legs])
    return complex(points.mean()), model.size


def _motions(points: NDArray[np.complex128], center: complex, scale: float) -> NDArray[np.complex128]:
    """Displacements (points x 3) of the unit motions along x, along y, and about the center."""
    return np.stack([np.ones_like(points), np.full_like(points, 1j), 1j * (points - center) / scale], axis=1)


def _constrain(motions: NDArray[np.complex128], directions: list[NDArray[np.complex128]]) -> NDArray[np.float64]:
    """At most 3 rows of 3: what prescribed components at many points demand of the unit motions."""
    components = [(motions * direction.conj()[:, None]).real for direction in directions]
    return np.asarray(np.linalg.qr(np.concatenate(components), mode="r"))


def _sample(model: Model, side: Side) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Points along a side and the outward normals there."""
    points, normals = [], []
    for leg in side_legs(model.curves, side):
        at = np.concatenate([[leg.start], inner_points(leg, 5), [leg.end]])
        if leg.center is None:
            normal = np.full(at.shape, -1j * leg.tangent(at_end=False))
        else:
            normal = (at - leg.center) / np.abs(at - leg.center) * np.sign(leg.sweep)
        points.append(at)
        normals.append(normal)
    return np.concatenate(points), np.concatenate(normals)


def _sides(loops: tuple[Loop, ...]) -> list[Side]:
    return [side for loop in loops for side in loop.sides]


def _boundary_rows(model: Model, names: list[str], center: complex, scale: float) -> list[NDArray[np.float64]]:
    rows = []
    for number, region in enumerate(model.regions):
        if region.infinite:  # held by what is far away
            rows.append(np.eye(3, 3 * len(names), 3 * number))
        for side in _sides(region.loops):
            condition = model.conditions.get(side.curve)
            if condition is None:
                continue
            points, normals = _sample(model, side)
            first = normals if condition.frame == "local" else np.ones_like(normals)
            prescribed = [
                direction for direction, quantity in zip((first, 1j * first), condition.known, strict=True)
                if quantity == "displacement"
            ]
            if prescribed:
                demands = _constrain(_motions(points, center, scale), prescribed)
                block = np.zeros((len(demands), 3 * len(names)))
                block[:, 3 * number:3 * number + 3] = demands
                rows.append(block)
    return rows


def _interface_rows(
    model: Model, names: list[str], held: Mapping[str, Tie], center: complex, scale: float
) -> list[NDArray[np.float64]]:
    rows = []
    for name, interface in model.interfaces.items():
        if interface.second is None or held[name] == "none":
            continue
        points, normals = _sample(model, Side(name, True))
        motions = _motions(points, center, scale)
        first, second = names.index(interface.first), names.index(interface.second)
        demands = _constrain(motions, [normals] if held[name] == "normal" else [normals, 1j * normals])
        block = np.zeros((len(demands), 3 * len(names)))
        block[:, 3 * first:3 * first + 3] = demands
        block[:, 3 * second:3 * second + 3] = -demands
        rows.append(block)
    return rows


def _sparse_basis(null: NDArray[np.float64]) -> NDArray[np.float64]:
    """The same space by vectors with many zeros: eliminate rotations first, so that what is left are translations."""
    basis = null.copy()
    columns = [*range(2, basis.shape[1], 3), *(c for c in range(basis.shape[1]) if c % 3 != 2)]
    row = 0
    for column in columns:
        if row == len(basis):
            break
        pivot = row + int(np.argmax(np.abs(basis[row:, column])))
        if abs(basis[pivot, column]) < 1e-6:
            continue
        basis[[row, pivot]] = basis[[pivot, row]]
        basis[row] /= basis[row, column]
        others = np.arange(len(basis)) != row
        basis[others] -= np.outer(basis[others, column], basis[row])
        row += 1
    basis[np.abs(basis) < 1e-9] = 0.0
    return basis


def _describe(vector: NDArray[np.float64], names: list[str], center: complex, scale: float) -> FreeMotion:
    velocities: dict[str, tuple[complex, float]] = {}
    parts: dict[str, list[str]] = {}
    for number, name in enumerate(names):
        x, y, turn = (float(value) for value in vector[3 * number:3 * number + 3])
        if max(abs(x), abs(y), abs(turn)) < 1e-6:
            continue
        spin = turn / scale
        velocities[name] = (complex(x, y) - 1j * spin * center, spin)
        if abs(turn) > 1e-6:
            pole = center + 1j * complex(x, y) / spin
            pole = complex(*(0.0 if abs(part) < 1e-9 * scale else part for part in (pole.real, pole.imag)))
            text = f"rotation about {format_point(pole)}"
        elif abs(y) < 1e-6 * abs(x):
            text = "translation along x"
        elif abs(x) < 1e-6 * abs(y):
            text = "translation along y"
        else:
            length = abs(complex(x, y))
            text = f"translation along ({x / length:.3g}, {y / length:.3g})"
        parts.setdefault(text, []).append(f"'{name}'")
    text = "; ".join(f"{motion} of {list_names(regions)}" for motion, regions in parts.items())
    return FreeMotion(tuple(velocities), velocities, text)
