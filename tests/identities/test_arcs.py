"""Rows of circular elements against quadrature of Kelvin's solutions along the arc, and against straight ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from pbem.bem.rows import Sources, evaluate_rows
from pbem.mesh.shape_functions import interpolate_shapes, place_nodes, tip_shapes
from pbem.model.material import Material
from tests.identities.kelvin import Kelvin, integrate_arc

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

MATERIAL = Material("rock", 4.3, 0.27)
KELVIN = Kelvin(MATERIAL.shear_modulus, MATERIAL.poisson)
CENTER, START, NORMAL = 0.3 - 0.2j, 0.3 - 0.2j + 1.3 * np.exp(0.4j), complex(np.exp(0.3j))
# With unit length of the logarithm; the mean of r_i r_j is left out of the rows.
SHIFT = -0.5 / (2 * np.pi * MATERIAL.shear_modulus * (MATERIAL.kappa + 1))

orders = pytest.mark.parametrize("order", [0, 1, 2, 3])
tips = pytest.mark.parametrize("tip", [0, 1, 2])
# Both senses of travel; up to a half circle; about where one panel of Gauss points no longer does.
sweeps = pytest.mark.parametrize("sweep", [0.01, 0.2, -0.5, 0.79, 0.81, np.pi / 2, -np.pi / 2, 2.5, np.pi])


def make_arc(order: int, tip: int, sweep: float) -> Sources:
    end = CENTER + (START - CENTER) * np.exp(1j * sweep)
    return Sources(
        np.array([START]), np.array([end]), np.array([tip], dtype=np.int8), place_nodes(order), MATERIAL.kappa,
        MATERIAL.shear_modulus, 1.0, np.array([CENTER]), np.array([sweep]),
    )  # fmt: skip


def list_points(sweep: float) -> dict[str, complex]:
    """Points about an arc, named: where they lie decides how the rows are computed."""
    apex = (START - CENTER) * np.exp(0.5j * sweep)
    half = abs(apex) * abs(2 * np.sin(sweep / 4))
    return {
        "inside": CENTER + 0.9 * apex * np.exp(0.1j * sweep),
        "outside": CENTER + 1.05 * apex * np.exp(-0.2j * sweep),
        "beside": CENTER + apex * (1 + 0.02 * half / abs(apex)),
        "ahead": CENTER + (START - CENTER) * np.exp(1.1j * sweep),
        "between": CENTER + apex * (1 - 1.3 * half / abs(apex)),
        "nearly far": CENTER + apex * (1 + 1.99 * half / abs(apex)),
        "just far": CENTER + apex * (1 + 2.01 * half / abs(apex)),
        "center": CENTER,
        "near center": CENTER + 1e-9,
        "third of radius": CENTER + 0.334 * apex * np.exp(0.6j),
        "less than a third": CENTER + 0.333 * apex * np.exp(0.6j),
        "opposite": CENTER - apex,
        "near opposite": CENTER - apex * (1 + 1e-9j),
        "distant": CENTER + 1e3 * (1 + 1j),
    }


def place_shapes(powers: Real, order: int, tip: int, scale: Real | float = 1.0) -> Real:
    """Integrals of powers (2, 2, p + 1) to columns of nodes (2, 2 (p + 1))."""
    local = place_nodes(order)
    shape = interpolate_shapes(local) if tip == 0 else tip_shapes(tuple(local))[tip - 1]
    return np.asarray(np.einsum("ijk,kn->inj", powers, shape * scale).reshape(2, -1))


def expect_rows(rows: Real | None, exact: Real, where: str, tolerance: float) -> None:
    assert rows is not None
    np.testing.assert_allclose(rows, exact, rtol=0, atol=tolerance * np.abs(exact).max(), err_msg=where)


@sweeps
@tips
@orders
def test_rows_of_displacements_are_integrals_along_the_arc(order: int, tip: int, sweep: float) -> None:
    arc, off = make_arc(order, tip, sweep), np.array([-1])
    for name, point in list_points(sweep).items():
        rows, _ = evaluate_rows(arc, np.array([point]), off)
        powers = integrate_arc(KELVIN.traction, point, CENTER, START, sweep, order + 1, tip)
        expect_rows(rows, -place_shapes(powers, order, tip), name, 1e-11)
        rows, _ = evaluate_rows(arc, np.array([point]), off, np.array([NORMAL]))
        stress = integrate_arc(KELVIN.stress_of_displacement, point, CENTER, START, sweep, order + 1, tip)
        powers = np.einsum("ijkp,j->ikp", stress, [NORMAL.real, NORMAL.imag])
        expect_rows(rows, -place_shapes(powers, order, tip), name, 1e-10)


def list_distances(sweep: float) -> dict[str, complex]:
    """Points at which every number of Gauss points is used, beyond and before each change of it."""
    apex = (START - CENTER) * np.exp(0.5j * sweep)
    half = abs(apex) * abs(2 * np.sin(sweep / 4))
    distances = [r * (1 + e) for r in (2.5, 3.5, 6.0, 8.0, 15.0, 20.0, 30.0, 70.0) for e in (-0.01, 0.01)]
    return {f"{r:.3f}": CENTER + apex + r * half * np.exp(2.4j * i) for i, r in enumerate(distances)}


@pytest.mark.parametrize("sweep", [0.05, -0.15, 0.3, 0.6])
@tips
@orders
def test_far_rows_reach_rounding_with_every_number_of_gauss_points(order: int, tip: int, sweep: float) -> None:
    arc, off, normal = make_arc(order, tip, sweep), np.array([-1]), np.array([NORMAL])
    scale = 1 / (1 + np.tan(sweep / 4) ** 2 * place_nodes(order) ** 2)
    for name, point in list_distances(sweep).items():
        at = np.array([point])
        displacement, of_tractions = evaluate_rows(arc, at, off)
        powers = integrate_arc(KELVIN.traction, point, CENTER, START, sweep, order + 1, tip)
        expect_rows(displacement, -place_shapes(powers, order, tip), name, 1e-12)
        traction, _ = evaluate_rows(arc, at, off, normal)
        stress = integrate_arc(KELVIN.stress_of_displacement, point, CENTER, START, sweep, order + 1, tip)
        powers = np.einsum("ijkp,j->ikp", stress, [NORMAL.real, NORMAL.imag])
        expect_rows(traction, -place_shapes(powers, order, tip), name, 1e-12)
        if tip:
            continue
        powers = integrate_arc(
            lambda r, n: KELVIN.displacement(r, n) + SHIFT * np.eye(2),
            point, CENTER, START, sweep, order + 1, of_tractions=True,
        )  # fmt: skip
        expect_rows(of_tractions, place_shapes(powers, order, 0, scale), name, 1e-12)


@sweeps
@orders
def test_rows_of_tractions_are_integrals_along_the_arc(order: int, sweep: float) -> None:
    arc, off = make_arc(order, 0, sweep), np.array([-1])
    scale = 1 / (1 + np.tan(sweep / 4) ** 2 * place_nodes(order) ** 2)

    def shifted(r: Real, n: Real) -> Real:
        return KELVIN.displacement(r, n) + SHIFT * np.eye(2)

    for name, point in list_points(sweep).items():
        _, rows = evaluate_rows(arc, np.array([point]), off)
        powers = integrate_arc(shifted, point, CENTER, START, sweep, order + 1, of_tractions=True)
        expect_rows(rows, place_shapes(powers, order, 0, scale), name, 1e-11)
        _, rows = evaluate_rows(arc, np.array([point]), off, np.array([NORMAL]))
        stress = integrate_arc(KELVIN.stress_of_traction, point, CENTER, START, sweep, order + 1, of_tractions=True)
        powers = np.einsum("ijkp,j->ikp", stress, [NORMAL.real, NORMAL.imag])
        expect_rows(rows, place_shapes(powers, order, 0, scale), name, 1e-11)


def place_on(order: int, sweep: float) -> tuple[Complex, Complex]:
    """Nodes on the arc and the outward normals there."""
    turn = 1j * np.tan(sweep / 4) * place_nodes(order)
    radius = (START - CENTER) * np.exp(0.5j * sweep) * (1 + turn) / (1 - turn)
    return CENTER + radius, np.sign(sweep) * radius / np.abs(radius)


@pytest.mark.parametrize("sweep", [0.2, -0.5, np.pi / 2])
@tips
@orders
def test_rows_on_the_arc_are_the_mean_of_both_sides(order: int, tip: int, sweep: float) -> None:
    arc, offset = make_arc(order, tip, sweep), 1e-8
    points, normal = place_on(order, sweep)
    zeros, off = np.zeros(len(points), dtype=int), np.full(len(points), -1)
    for normals in (None, np.full(len(points), NORMAL)):
        on = evaluate_rows(arc, points, zeros, normals, on_local=place_nodes(order))
        sides = [evaluate_rows(arc, points + d * normal, off, normals) for d in (offset, -offset)]
        for which in (0, 1):
            one, outside, inside = on[which], sides[0][which], sides[1][which]
            assert one is not None and outside is not None and inside is not None
            np.testing.assert_allclose(one, (outside + inside) / 2, rtol=0, atol=2e-6 * np.abs(one).max() + 1e-12)


@pytest.mark.parametrize("sweep", [0.2, -0.5, np.pi / 2])
@orders
def test_displacement_and_traction_jump_by_their_densities(order: int, sweep: float) -> None:
    arc, offset = make_arc(order, 0, sweep), 1e-9
    points, normal = place_on(order, sweep)
    off, one = np.full(len(points), -1), np.eye(2 * len(points))
    inside, outside = (evaluate_rows(arc, points - d * normal, off)[0] for d in (offset, -offset))
    np.testing.assert_allclose(inside - outside, one, atol=1e-6)
    inner, outer = (evaluate_rows(arc, points - d * normal, off, normal)[1] for d in (offset, -offset))
    assert inner is not None and outer is not None
    np.testing.assert_allclose(inner - outer, one, atol=1e-6)


@tips
@orders
def test_a_flat_arc_is_a_straight_element(order: int, tip: int) -> None:
    # A chord of 1 under a sagitta of 1e-7.
    sweep = 8e-7
    half, middle = 0.5 * np.exp(0.4j), 0.2 + 0.1j
    radius = 0.5 / np.sin(sweep / 2)
    start, end = np.array([middle - half]), np.array([middle + half])
    straight = Sources(start, end, np.array([tip], dtype=np.int8), place_nodes(order), 1.8, 1.3, 1.0)
    center = middle + 2j * half * radius * np.cos(sweep / 2)
    arc = replace(straight, center=np.array([center]), sweep=np.array([sweep]))
    points, off = middle + np.array([0.1 + 0.3j, -0.4 + 1.2j, 2.0 + 0j, 5.0 - 9.0j]), np.full(4, -1)
    for normal in (None, np.full(4, NORMAL)):
        for one, other in zip(
            evaluate_rows(straight, points, off, normal), evaluate_rows(arc, points, off, normal), strict=True
        ):
            assert one is not None and other is not None
            np.testing.assert_allclose(other, one, rtol=0, atol=2e-6 * np.abs(one).max() + 1e-12)


def test_more_than_half_a_circle_is_refused() -> None:
    with pytest.raises(ValueError, match="half a circle"):
        evaluate_rows(make_arc(2, 0, 3.3), np.array([0j]), np.array([-1]))
