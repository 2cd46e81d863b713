"""From densities to coefficients, from cluster to cluster, to values at points: against the rows of the elements."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from pbem.bem.rows import Sources, evaluate_rows
from pbem.mesh.shape_functions import place_crack_nodes, place_nodes
from tests.unit.series_twin import Medium, apply_l2l, apply_m2l, apply_m2m, form_l2p, form_p2m, shift_matrices

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

KAPPA, MODULUS, LENGTH = 1.9, 1.7, 30.0
FAMILIES = {"boundary": 0, "tip at start": 1, "tip at end": 2, "crack": 3}
SWEEPS = {"straight": 0.0, "bent": 0.7, "bent back": -1.4, "half circle": np.pi, "half circle back": -np.pi}
orders = pytest.mark.parametrize("order", [0, 1, 2, 3])
families = pytest.mark.parametrize("family", FAMILIES.values(), ids=FAMILIES.keys())
sweeps = pytest.mark.parametrize("sweep", SWEEPS.values(), ids=SWEEPS.keys())
kinds = pytest.mark.parametrize("traction", [False, True], ids=["displacement", "traction"])


@dataclass(frozen=True)
class Circle:
    center: complex
    radius: float


def make_elements(
    order: int, family: int = 0, sweep: float = 0.0, count: int = 3, size: float = 1.0, place: complex = 0j,
    modulus: float = MODULUS, length: float = LENGTH,
) -> tuple[Sources, Circle]:
    """Some alike elements and a circle around them, of about the given radius about a place."""
    random = np.random.default_rng(order + 10 * family)
    middle = place + size * (random.uniform(-0.4, 0.4, (count, 2)) @ [1, 1j])
    half = 0.3 * size * np.exp(2j * np.pi * random.random(count))
    start, end = middle - half, middle + half
    center = np.zeros(count, dtype=complex)
    if sweep != 0:
        turn = np.exp(1j * sweep)
        center = (end - start * turn) / (1 - turn)
    sources = Sources(
        start, end, np.full(count, family, dtype=np.int8), place_nodes(order), KAPPA, modulus, length, center,
        np.full(count, sweep), place_crack_nodes(order),
    )  # fmt: skip
    return sources, Circle(place, float((np.abs(middle - place) + np.abs(half)).max()))


def evaluate_directly(sources: Sources, point: Complex, normal: Complex | None) -> Real:
    """Values at points as functions of all nodal values, by the kernels."""
    bounded = bool((sources.family == 0).any())
    rows = evaluate_rows(sources, point, np.full(len(point), -1), normal, bounded)
    return np.concatenate([part for part in rows if part is not None], axis=1)


def evaluate_far(
    sources: Sources, around: list[Circle], seen: list[Circle], point: Complex, normal: Complex | None, terms: int
) -> Real:
    """The same by expansions: about the first circle, moved to the next ones, carried over to the first of those seen,
    moved to the next, evaluated at the points."""
    first = form_p2m(sources, around[0].center, around[0].radius, terms)
    columns = first.shape[1]
    moments = np.ascontiguousarray(first.T).view(complex).reshape(columns, 2, terms + 1)
    for inner, outer in pairwise(around):
        offset, small, large = (np.full(columns, value) for value in
                                (inner.center - outer.center, inner.radius, outer.radius))  # fmt: skip
        shift = shift_matrices(offset, small, large, terms)
        moments = apply_m2m(moments, shift, offset, small, large)
    source, target = around[-1], seen[0]
    fields = apply_m2l(
        moments, np.full(columns, target.center - source.center), np.full(columns, source.radius),
        np.full(columns, target.radius), np.full(columns, sources.length),
    )  # fmt: skip
    for outer, inner in pairwise(seen):
        offset, small, large = (np.full(columns, value) for value in
                                (inner.center - outer.center, inner.radius, outer.radius))  # fmt: skip
        fields = apply_l2l(fields, shift_matrices(offset, small, large, terms), offset, large)
    flat = np.ascontiguousarray(fields).view(float).reshape(columns, -1)
    last, medium = seen[-1], Medium(sources.kappa, sources.shear_modulus)
    return form_l2p(point, normal, medium, last.center, last.radius, terms) @ flat.T


def place_points(circle: Circle, count: int = 7) -> tuple[Complex, Complex]:
    """Points in a circle, its rim among them, and normals."""
    angle = 2 * np.pi * np.arange(count) / count
    point = circle.center + circle.radius * np.linspace(0, 1, count) * np.exp(1j * angle)
    return point, np.exp(1j * (0.3 + 2 * angle))


def measure_errors(
    sources: Sources, around: list[Circle], seen: list[Circle], traction: bool, terms: int
) -> tuple[Real, Real]:
    """Relative errors of the columns of displacements and of tractions: (u), (t or nothing)."""
    point, normal = place_points(seen[-1])
    chosen = normal if traction else None
    exact = evaluate_directly(sources, point, chosen)
    found = evaluate_far(sources, around, seen, point, chosen, terms)
    assert found.shape == exact.shape
    width = 2 * sources.count * len(sources.local)
    parts = [slice(0, width), slice(width, None)]
    errors = [np.abs(found - exact)[:, part].max(initial=0) / (np.abs(exact)[:, part].max(initial=0) or 1.0)
              for part in parts if exact[:, part].size]  # fmt: skip
    return errors[0], errors[1] if len(errors) > 1 else 0.0


def list_far(circle: Circle) -> list[Circle]:
    """A circle that sees another's points from so far that errors fall by a half a term, and a smaller one in it."""
    target = Circle(circle.center + 2.9 * circle.radius * np.exp(0.7j), 0.9 * circle.radius)
    return [target, Circle(target.center + 0.2j * target.radius, 0.7 * target.radius)]


def enclose(circle: Circle) -> list[Circle]:
    """A circle, and one around it whose centre is another."""
    outer = Circle(circle.center - 0.3 * circle.radius * np.exp(1j), 1.4 * circle.radius)
    return [circle, outer, Circle(outer.center + 0.1 * circle.radius, 1.6 * circle.radius)]


@kinds
@sweeps
@families
@orders
def test_expansions_are_the_rows(order: int, family: int, sweep: float, traction: bool) -> None:
    sources, circle = make_elements(order, family, sweep)
    around = enclose(circle)
    errors = measure_errors(sources, around, list_far(around[-1]), traction, 52)
    # Derivatives lose a few digits, as their terms grow like the square of the number.
    assert max(errors) < (3e-11 if traction else 1e-12), errors


@kinds
@pytest.mark.parametrize("family", [0, 1, 3])
@pytest.mark.parametrize("sweep", [0.0, 1.2])
def test_errors_fall_by_the_ratio_from_term_to_term(sweep: float, family: int, traction: bool) -> None:
    sources, circle = make_elements(2, family, sweep)
    around = [circle, Circle(circle.center - 0.2j * circle.radius, 1.2 * circle.radius)]
    for distance in (2.6, 3.5, 6.0):
        outer = around[-1]
        seen = [Circle(outer.center - distance * outer.radius * np.exp(0.4j), outer.radius)]
        ratio = 1 / (distance - 1)  # of the criterion: radius over distance less the other radius
        errors = {terms: max(measure_errors(sources, around, seen, traction, terms)) for terms in (6, 12, 18)}
        for terms, error in errors.items():
            assert error < 6 * terms * ratio**terms, (distance, terms)
        assert errors[12] < 0.2 * errors[6] and errors[18] < max(0.2 * errors[12], 1e-12)


@kinds
@families
def test_moved_coefficients_are_those_about_the_other_centre(family: int, traction: bool) -> None:
    sources, circle = make_elements(2, family, 0.8)
    terms, outer = 30, enclose(circle)[1]
    offset, small, large = np.array([circle.center - outer.center]), np.array([circle.radius]), np.array([outer.radius])
    first = form_p2m(sources, circle.center, circle.radius, terms)
    moments = np.ascontiguousarray(first.T).view(complex).reshape(-1, 2, terms + 1)
    columns = len(moments)
    shift = np.tile(shift_matrices(offset, small, large, terms), (columns, 1, 1))
    moved = apply_m2m(moments, shift, np.tile(offset, columns), np.tile(small, columns),
                                 np.tile(large, columns))  # fmt: skip
    exact = form_p2m(sources, outer.center, outer.radius, terms).T
    exact = np.ascontiguousarray(exact).view(complex).reshape(-1, 2, terms + 1)
    # Moving multipoles is exact term by term; an arc's integrals by Gauss points are not.
    np.testing.assert_allclose(moved, exact, rtol=0, atol=1e-11 * np.abs(exact).max())


@kinds
def test_moved_fields_are_the_same_at_points(traction: bool) -> None:
    random = np.random.default_rng(3)
    terms, outer, inner = 17, Circle(0.4 - 0.3j, 1.3), Circle(0.1 + 0.2j, 0.5)
    fields = random.normal(size=(4, 2, terms + 1)) + 1j * random.normal(size=(4, 2, terms + 1))
    offset, small, large = np.full(4, inner.center - outer.center), np.full(4, inner.radius), np.full(4, outer.radius)
    moved = apply_l2l(fields, shift_matrices(offset, small, large, terms), offset, large)
    point, normal = place_points(inner)
    values = [
        form_l2p(point, normal if traction else None, Medium(KAPPA, MODULUS), each.center, each.radius, terms)
        @ np.ascontiguousarray(part).view(float).reshape(4, -1).T
        for each, part in ((outer, fields), (inner, moved))
    ]
    np.testing.assert_allclose(values[1], values[0], rtol=0, atol=1e-12 * np.abs(values[0]).max())


@kinds
@pytest.mark.parametrize("length", [1.0, 30.0, 1e4])
def test_the_unit_of_the_logarithm_is_heeded(length: float, traction: bool) -> None:
    sources, circle = make_elements(2, length=length)
    around = enclose(circle)
    assert max(measure_errors(sources, around, list_far(around[-1]), traction, 52)) < 3e-11


# Lengths in m and mm, stresses in GPa, MPa and Pa.
@kinds
@pytest.mark.parametrize("modulus", [1e-3, 1.0, 1e9])
@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize(("family", "sweep"), [(0, 0.0), (0, 1.0), (1, 0.0), (3, 0.5)])
def test_units_do_not_matter(family: int, sweep: float, size: float, modulus: float, traction: bool) -> None:
    sources, circle = make_elements(2, family, sweep, 3, size, size * (3 - 2j), modulus, 30 * size)
    around = enclose(circle)
    assert max(measure_errors(sources, around, list_far(around[-1]), traction, 52)) < 3e-11


def test_circles_of_very_different_sizes_see_each_other() -> None:
    """A cluster of small elements far from large ones, both ways."""
    for size, radius in ((1e-6, 1.0), (1.0, 1e-6)):
        sources, circle = make_elements(2, size=size, length=100.0)
        seen = [Circle(circle.center + 3 * (circle.radius + radius) * np.exp(2j), radius)]
        for traction in (False, True):
            assert max(measure_errors(sources, [circle], seen, traction, 40)) < 1e-11


def test_elements_of_all_families_together() -> None:
    sources, circle = make_elements(2, count=4)
    mixed = replace(sources, family=np.array([0, 1, 2, 3], dtype=np.int8))
    around = enclose(circle)
    for traction in (False, True):
        assert max(measure_errors(mixed, around, list_far(around[-1]), traction, 52)) < 3e-11
    # Tractions of crack elements count nothing.
    width = 4 * 2 * 3
    matrix = form_p2m(mixed, circle.center, circle.radius, 10)
    assert matrix.shape == (44, 2 * width)
    assert np.abs(matrix[:, width : width + 6]).max() > 0 and not matrix[:, width + 6 :].any()
    cracks = replace(mixed, family=np.array([1, 1, 2, 3], dtype=np.int8))
    assert form_p2m(cracks, circle.center, circle.radius, 10).shape == (44, width)
