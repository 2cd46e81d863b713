"""The rows of both equations against quadrature of Kelvin's solutions, and against each other by Hooke's law."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from pbem.bem.rows import Sources, evaluate_rows
from pbem.mesh.shape_functions import interpolate_shapes, place_nodes, tip_shapes
from pbem.model.material import Material
from tests.identities.kelvin import Kelvin, integrate

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

MATERIALS = {
    "strain": Material("rock", 4.3, 0.27, "strain"),
    "stress": Material("sheet", 4.3, 0.27, "stress"),
    "auxetic": Material("foam", 0.9, -0.4, "strain"),
}
LENGTH = 3.7  # unit of the logarithm in the compiled rows

orders = pytest.mark.parametrize("order", [0, 1, 2, 3])
tips = pytest.mark.parametrize("tip", [0, 1, 2])
materials = pytest.mark.parametrize("material", MATERIALS.values(), ids=MATERIALS.keys())


def make_element(order: int, tip: int, material: Material, start: complex, end: complex) -> Sources:
    return Sources(
        np.array([start]), np.array([end]), np.array([tip], dtype=np.int8), place_nodes(order), material.kappa,
        material.shear_modulus, LENGTH,
    )  # fmt: skip


def make_kelvin(material: Material) -> Kelvin:
    """With the ratio nu/(1 + nu) the formulas of plane strain are those of plane stress."""
    nu = material.poisson
    return Kelvin(material.shear_modulus, nu if material.plane == "strain" else nu / (1 + nu))


def place_shapes(powers: Real, order: int, tip: int) -> Real:
    """Integrals of powers (2, 2, p + 1) to columns of nodes (2, 2 (p + 1)), x and y interleaved."""
    local = place_nodes(order)
    shape = interpolate_shapes(local) if tip == 0 else tip_shapes(tuple(local))[tip - 1]
    return np.asarray(np.einsum("ijk,kn->inj", powers, shape).reshape(2, -1))


def split(z: complex) -> Real:
    return np.array([z.real, z.imag])


def draw_places(seed: int, count: int, nearest: float) -> list[tuple[complex, complex, complex, complex]]:
    """Start and end of an element, a point at least nearest elements away from it, and a direction there."""
    random = np.random.default_rng(seed)
    places = []
    while len(places) < count:
        start, end, point = random.normal(size=(3, 2)) @ [1, 1j]
        w = (point - start) / (end - start)
        if abs(w - min(1.0, max(0.0, w.real))) >= nearest:
            places.append((start, end, point, np.exp(1j * random.uniform(0, 2 * np.pi))))
    return places


@materials
@tips
@orders
def test_displacement_of_displacements_is_the_integral_of_the_traction_kernel(
    order: int, tip: int, material: Material
) -> None:
    kelvin = make_kelvin(material)
    for start, end, point, _ in draw_places(1, 5, 1e-2):
        rows, _ = evaluate_rows(make_element(order, tip, material, start, end), np.array([point]), np.array([-1]))
        exact = place_shapes(integrate(kelvin.traction, point, start, end, order + 1, tip), order, tip)
        np.testing.assert_allclose(rows, -exact, rtol=0, atol=1e-12 * np.abs(exact).max())


@materials
@orders
def test_displacement_of_tractions_is_the_integral_of_the_displacement_kernel(order: int, material: Material) -> None:
    kelvin = make_kelvin(material)
    kappa = material.kappa
    # Kelvin's solution is known up to a translation: here the logarithm has a unit, the mean of r_i r_j is left out.
    shift = (kappa * np.log(LENGTH) - 0.5) / (2 * np.pi * material.shear_modulus * (kappa + 1))

    def shifted(r: Real, n: Real) -> Real:
        return kelvin.displacement(r, n) + shift * np.eye(2)

    for start, end, point, _ in draw_places(2, 5, 1e-2):
        _, rows = evaluate_rows(make_element(order, 0, material, start, end), np.array([point]), np.array([-1]))
        exact = place_shapes(integrate(shifted, point, start, end, order + 1), order, 0)
        assert rows is not None
        np.testing.assert_allclose(rows, exact, rtol=0, atol=1e-12 * np.abs(exact).max())


@materials
@tips
@orders
def test_traction_of_displacements_is_the_integral_of_the_hypersingular_kernel(
    order: int, tip: int, material: Material
) -> None:
    kelvin = make_kelvin(material)
    for start, end, point, normal in draw_places(3, 5, 0.1):
        element = make_element(order, tip, material, start, end)
        rows, _ = evaluate_rows(element, np.array([point]), np.array([-1]), np.array([normal]))
        stress = integrate(kelvin.stress_of_displacement, point, start, end, order + 1, tip)
        exact = place_shapes(np.einsum("ijkp,j->ikp", stress, split(normal)), order, tip)
        np.testing.assert_allclose(rows, -exact, rtol=0, atol=1e-12 * np.abs(exact).max())


@materials
@orders
def test_traction_of_tractions_is_the_integral_of_the_adjoint_kernel(order: int, material: Material) -> None:
    kelvin = make_kelvin(material)
    for start, end, point, normal in draw_places(4, 5, 0.1):
        element = make_element(order, 0, material, start, end)
        _, rows = evaluate_rows(element, np.array([point]), np.array([-1]), np.array([normal]))
        stress = integrate(kelvin.stress_of_traction, point, start, end, order + 1)
        exact = place_shapes(np.einsum("ijkp,j->ikp", stress, split(normal)), order, 0)
        assert rows is not None
        np.testing.assert_allclose(rows, exact, rtol=0, atol=1e-12 * np.abs(exact).max())


# Weights of f(x + k h) - f(x - k h), k = 1 .. 4, in the derivative: exact to degree 8.
STENCIL = np.array([4 / 5, -1 / 5, 4 / 105, -1 / 280])


def differentiate(rows: Callable[[Complex], Real], point: complex, step: float) -> tuple[Real, Real]:
    """Derivatives by x and y of rows (2, columns) at a point."""
    derivatives = []
    for direction in (1.0, 1j):
        offset = step * direction * np.arange(1, 5)
        values = rows(np.concatenate([point + offset, point - offset])).reshape(8, 2, -1)
        derivatives.append(np.einsum("k,kij->ij", STENCIL, values[:4] - values[4:]) / step)
    return derivatives[0], derivatives[1]


def apply_hooke(by_x: Real, by_y: Real, normal: complex, material: Material) -> Real:
    """Rows (2, columns) of the traction on a normal from the gradients of rows of the displacement."""
    shear, kappa = material.shear_modulus, material.kappa
    lame = shear * (3 - kappa) / (kappa - 1)
    dilatation = by_x[0] + by_y[1]
    sxx, syy = lame * dilatation + 2 * shear * by_x[0], lame * dilatation + 2 * shear * by_y[1]
    sxy = shear * (by_x[1] + by_y[0])
    n = split(normal)
    return np.stack([sxx * n[0] + sxy * n[1], sxy * n[0] + syy * n[1]])


@materials
@tips
@orders
@pytest.mark.parametrize("distance", [0.3, 1e-3, 1e-6, 1e3])
def test_traction_rows_are_hooke_s_law_of_displacement_rows(
    distance: float, order: int, tip: int, material: Material
) -> None:
    start, end, normal = 0.2 - 0.3j, 0.5 + 0.8j, np.exp(0.7j)
    element = make_element(order, tip, material, start, end)
    point = start + (0.37 - distance * 1j) * (end - start)
    # Beside the element the field is smooth on the scale of the element: the step only has to stay on one side.
    step = (0.2 if distance < 0.01 else 0.02) * distance * abs(end - start)

    def displacement(points: Complex) -> tuple[Real, Real]:
        first, second = evaluate_rows(element, points, np.full(len(points), -1))
        assert second is not None
        return first, second

    exact = evaluate_rows(element, np.array([point]), np.array([-1]), np.array([normal]))
    for which in (0, 1):
        rows = exact[which]
        assert rows is not None
        derivatives = differentiate(lambda points, k=which: displacement(points)[k], point, step)  # type: ignore[misc]
        by_hooke = apply_hooke(*derivatives, normal, material)
        # Rounding of the displacement rows, of order 1 (of the logarithm's for tractions), over the step.
        size = np.abs(displacement(np.array([point]))[which]).max()
        rounding = 4e-16 * size * material.plane_modulus / step
        np.testing.assert_allclose(rows, by_hooke, rtol=0, atol=1e-10 * np.abs(by_hooke).max() + 20 * rounding)


@materials
@tips
@orders
def test_rows_on_the_element_are_the_mean_of_both_sides(order: int, tip: int, material: Material) -> None:
    # The limits from the two sides differ by the free term; their mean is the principal value or finite part.
    start, end, normal, offset = -0.6 + 0.1j, 0.9 + 0.7j, np.exp(2.1j), 1e-9
    element = make_element(order, tip, material, start, end)
    points = (start + end) / 2 + place_nodes(order) * (end - start) / 2
    for normals in (None, np.full(len(points), normal)):
        on = evaluate_rows(element, points, np.zeros(len(points), dtype=int), normals)
        side = [evaluate_rows(element, points + d * 1j * (end - start), np.full(len(points), -1), normals)
                for d in (offset, -offset)]  # fmt: skip
        for which in (0, 1):
            one, above, below = on[which], side[0][which], side[1][which]
            assert one is not None and above is not None and below is not None
            np.testing.assert_allclose(one, (above + below) / 2, rtol=0, atol=1e-7 * np.abs(one).max())


@materials
@orders
def test_displacement_jumps_by_the_density_across_the_element(order: int, material: Material) -> None:
    start, end, offset = -0.6 + 0.1j, 0.9 + 0.7j, 1e-9
    for tip in (0, 1, 2):
        element = make_element(order, tip, material, start, end)
        points = (start + end) / 2 + place_nodes(order) * (end - start) / 2
        left, right = (
            evaluate_rows(element, points + d * 1j * (end - start), np.full(len(points), -1))[0]
            for d in (offset, -offset)
        )
        # Seen from the region, on the left, the displacement comes out as itself; outside it is missing.
        np.testing.assert_allclose(left - right, np.eye(2 * len(points)), atol=1e-6)


@materials
@orders
def test_traction_jumps_by_the_density_across_the_element(order: int, material: Material) -> None:
    start, end, offset = -0.6 + 0.1j, 0.9 + 0.7j, 1e-9
    element = make_element(order, 0, material, start, end)
    points = (start + end) / 2 + place_nodes(order) * (end - start) / 2
    normal = np.full(len(points), -1j * (end - start) / abs(end - start))
    left, right = (
        evaluate_rows(element, points + d * 1j * (end - start), np.full(len(points), -1), normal)[1]
        for d in (offset, -offset)
    )
    assert left is not None and right is not None
    np.testing.assert_allclose(left - right, np.eye(2 * len(points)), atol=1e-6)


def test_traction_densities_of_tip_elements_are_left_out() -> None:
    element = make_element(2, 1, MATERIALS["strain"], 0j, 1 + 0j)
    for normal in (None, np.array([1j])):
        _, rows = evaluate_rows(element, np.array([0.3 + 0.4j]), np.array([-1]), normal)
        assert rows is not None and not rows.any()


def make_many(order: int, count: int) -> Sources:
    """Random elements of all families and sizes, near and far from each other: arcs and tips among straight ones."""
    random = np.random.default_rng(order)
    start = random.normal(size=(count, 2)) @ [1, 1j]
    end = start + random.lognormal(-2, 1.5, count) * np.exp(2j * np.pi * random.random(count))
    sweep = np.where(random.random(count) < 0.05, 0.3, 0.0)
    turn = np.exp(1j * np.where(sweep == 0, 1.0, sweep))
    center = np.where(sweep == 0, 0, (end - start * turn) / (1 - turn))
    family = random.choice(np.array([0, 0, 0, 0, 0, 0, 1, 2, 3, 3, 3], dtype=np.int8), count)
    nodes = place_nodes(order)
    return Sources(start, end, family, nodes, 1.8, 1.3, LENGTH, center, sweep, 0.9 * nodes)


@orders
@pytest.mark.parametrize("count", [1, 63, 64, 65, 200])
def test_every_element_counts_as_if_it_were_alone(count: int, order: int) -> None:
    # However the elements are grouped for the processor, and whichever of them are near the point.
    sources = make_many(order, count)
    random = np.random.default_rng(count)
    beside = (sources.start + sources.end) / 2 + 0.2j * (sources.end - sources.start)
    points = np.concatenate([beside[:5], random.normal(size=(5, 2)) @ [1, 1j], [1e3 + 1e2j]])
    on_straight = np.flatnonzero((sources.sweep == 0) & (sources.family == 0))[:2]
    points = np.concatenate([points, (sources.start + sources.end)[on_straight] / 2])
    on = np.concatenate([np.full(len(points) - len(on_straight), -1), on_straight])
    for normal in (None, np.exp(1j * np.arange(len(points)))):
        together = evaluate_rows(sources, points, on, normal)
        for element in range(0, count, 1 if count < 70 else 7):
            at = slice(2 * element * (order + 1), 2 * (element + 1) * (order + 1))
            alone = evaluate_rows(take_element(sources, element), points, np.where(on == element, 0, -1), normal)
            for whole, one in zip(together, alone, strict=True):
                assert whole is not None and one is not None
                scale = np.abs(one).max(axis=1, keepdims=True)
                assert np.all(np.abs(whole[:, at] - one) <= 1e-13 * scale), f"element {element}"


def take_element(sources: Sources, element: int) -> Sources:
    own = slice(element, element + 1)
    assert sources.center is not None and sources.sweep is not None
    return replace(
        sources, start=sources.start[own], end=sources.end[own], family=sources.family[own],
        center=sources.center[own], sweep=sources.sweep[own],
    )  # fmt: skip


@orders
def test_without_tractions_the_rows_of_displacements_are_the_same(order: int) -> None:
    sources = make_many(order, 100)
    points, off = np.random.default_rng(7).normal(size=(9, 2)) @ [1, 1j], np.full(9, -1)
    for normal in (None, np.exp(1j * np.arange(9))):
        with_tractions, without = (evaluate_rows(sources, points, off, normal, kind) for kind in (True, False))
        one, other = with_tractions[0], without[0]
        # The two are compiled apart: roundings differ, which near an element grow by what its recursions lose.
        scale = np.abs(one).reshape(len(one), 100, -1).max(axis=2)
        assert np.all(np.abs(one - other).reshape(len(one), 100, -1).max(axis=2) <= 1e-13 * scale)
        assert without[1] is None


@orders
def test_selected_elements_keep_their_columns(order: int) -> None:
    sources = make_many(order, 40)
    chosen = np.array([31, 2, 3, 17, 8])
    points, off = np.random.default_rng(3).normal(size=(6, 2)) @ [1, 1j], np.full(6, -1)
    columns = (2 * (order + 1) * chosen[:, None] + np.arange(2 * (order + 1))).ravel()
    for normal in (None, np.exp(1j * np.arange(6))):
        whole, part = (evaluate_rows(one, points, off, normal) for one in (sources, sources.select(chosen)))
        for all_columns, own in zip(whole, part, strict=True):
            assert all_columns is not None and own is not None
            scale = np.abs(own).max()
            np.testing.assert_allclose(own, all_columns[:, columns], rtol=0, atol=1e-13 * scale)


@orders
def test_rows_do_not_depend_on_how_many_points_are_given_together(order: int) -> None:
    # To the last digit: then neither do they depend on the number of ranks.
    sources = make_many(order, 90)
    points = np.concatenate([np.random.default_rng(4).normal(size=(300, 2)) @ [1, 1j], sources.start[:20] + 1e-3])
    off, normals = np.full(len(points), -1), np.exp(1j * np.arange(len(points)))
    for normal in (None, normals):
        whole = evaluate_rows(sources, points, off, normal)
        for begin, end in ((0, 1), (1, 8), (8, 301), (301, 320)):
            own = slice(begin, end)
            part = evaluate_rows(sources, points[own], off[own], None if normal is None else normal[own])
            for all_rows, rows in zip(whole, part, strict=True):
                assert all_rows is not None and rows is not None
                np.testing.assert_array_equal(rows, all_rows[2 * begin : 2 * end])
