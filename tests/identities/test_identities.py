"""What holds exactly in discrete form: equilibrium fields within the shapes' reach satisfy both boundary equations."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from pbem.bem.operator import collect_sources
from pbem.bem.rows import evaluate_rows
from pbem.exact import PlaneField, polynomial_field, uniform_field
from pbem.mesh.mesh import Mesh
from pbem.model.material import Material
from pbem.model.model import Model
from tests.identities.bodies import (
    ROCK,
    Body,
    apply_operator,
    draw_polygon,
    list_edges,
    make_polygon,
    mesh_body,
    sample_field,
)

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

SHEET = Material("sheet", 0.8, 0.4, "stress")
both_equations = pytest.mark.parametrize("traction", [False, True], ids=["displacement", "traction"])
both_materials = pytest.mark.parametrize("material", [ROCK, SHEET], ids=["strain", "stress"])
seeds = pytest.mark.parametrize("seed", [1, 2, 3])


def make_holed_polygon(seed: int, order: int, material: Material = ROCK) -> tuple[Model, Mesh]:
    """A random polygon with a triangular hole, unequal elements."""
    random = np.random.default_rng(seed)
    vertices = draw_polygon(random, 6)
    center = np.mean(vertices)
    hole = [complex(center + 0.2 * np.exp(1j * (a + seed))) for a in (0.0, 2.0, 4.0)]
    curves = list_edges(vertices) | list_edges(hole, "hole")
    held = {name: {"ux": 0.0, "uy": 0.0} for name in curves}
    counts = {name: 3 + number % 3 for number, name in enumerate(curves)}
    return mesh_body(Body(curves, {"body": (material, list(curves))}, held, elements=counts, order=order))


def make_polynomial(seed: int, degree: int, material: Material) -> PlaneField:
    random = np.random.default_rng(seed)
    phi, psi = random.normal(size=(2, degree + 1, 2)) @ [1, 1j] * material.shear_modulus
    return polynomial_field(material.kappa, material.shear_modulus, list(phi), list(psi))


def expect_zero(model: Model, mesh: Mesh, exact: PlaneField, traction: bool, tolerance: float = 1e-12) -> None:
    """Both terms of the equation are much larger than what is left of them."""
    v = sample_field(exact, mesh)
    left = apply_operator(mesh, [model.regions[0].material], v, traction, model.size)
    size = np.abs(v[: 2 * mesh.nodes]).max()
    if traction:  # the derivative of the displacement on the shortest element
        size *= model.size / np.abs(mesh.end - mesh.start).min()
    assert np.abs(left).max() <= tolerance * size


@both_materials
@both_equations
@pytest.mark.parametrize("order", [0, 1, 2, 3])
def test_translations_satisfy_both_equations(order: int, traction: bool, material: Material) -> None:
    model, mesh = make_holed_polygon(1, order, material)
    for translation in (1.0, 1j, -0.3 + 0.7j):
        rigid = uniform_field(material.kappa, material.shear_modulus, (0, 0, 0), translation=translation)
        expect_zero(model, mesh, rigid, traction)


@both_materials
@both_equations
@seeds
@pytest.mark.parametrize("order", [1, 2, 3])
def test_linear_fields_satisfy_both_equations(order: int, seed: int, traction: bool, material: Material) -> None:
    model, mesh = make_holed_polygon(seed, order, material)
    random = np.random.default_rng(seed)
    rotation = uniform_field(material.kappa, material.shear_modulus, (0, 0, 0), rotation=1.0)
    expect_zero(model, mesh, rotation, traction)
    for _ in range(3):
        sxx, syy, sxy, turn, x, y = random.normal(size=6)
        linear = uniform_field(material.kappa, material.shear_modulus, (sxx, syy, sxy), turn, complex(x, y))
        expect_zero(model, mesh, linear, traction)


@both_materials
@both_equations
@seeds
@pytest.mark.parametrize("order", [2, 3])
def test_polynomial_fields_of_the_shapes_degree_satisfy_both_equations(
    order: int, seed: int, traction: bool, material: Material
) -> None:
    model, mesh = make_holed_polygon(seed, order, material)
    expect_zero(model, mesh, make_polynomial(seed, order, material), traction)


@both_equations
def test_graded_meshes_satisfy_both_equations(traction: bool) -> None:
    # Elements from 1/500 to 1/3 of a side next to each other.
    body = make_polygon([0j, 2 + 0.1j, 2.2 + 1j, 0.1 + 1.3j], elements=12, grading="both", order=2)
    model, mesh = mesh_body(body)
    lengths = np.abs(mesh.end - mesh.start)
    assert lengths.max() > 70 * lengths.min()
    # A node's place is rounded by some 1e-13 of the smallest element, which the hypersingular kernel feels.
    expect_zero(model, mesh, make_polynomial(5, 2, ROCK), traction, 1e-11 if traction else 1e-12)


def test_the_identities_can_fail() -> None:
    # A field that is not in equilibrium, or of too high a degree, is seen.
    model, mesh = make_holed_polygon(1, 2)
    for exact in (make_polynomial(1, 3, ROCK), make_polynomial(1, 2, Material("other", 4.3, 0.1))):
        for traction in (False, True):
            with pytest.raises(AssertionError):
                expect_zero(model, mesh, exact, traction, 1e-6)


def place_inside(mesh: Mesh, distance: float) -> Complex:
    """Points beside the elements, at a distance in units of the element, along its length."""
    along = np.array([-0.9, -0.2, 0.55])
    middle, half = (mesh.start + mesh.end) / 2, (mesh.end - mesh.start) / 2
    return np.asarray((middle[:, None] + half[:, None] * (along + 2j * distance)).ravel())


def evaluate_inside(model: Model, mesh: Mesh, v: Real, points: Complex, normal: complex | None) -> Complex:
    """Displacement, or traction on a normal, at points off the boundary from the boundary values v."""
    normals = None if normal is None else np.full(len(points), normal)
    first, second = evaluate_rows(
        collect_sources(mesh, [model.regions[0].material])[0], points, np.full(len(points), -1), normals
    )
    values = first @ v[: 2 * mesh.nodes] + second @ v[2 * mesh.nodes :]
    return np.asarray(values[0::2] + 1j * values[1::2])


@both_materials
@seeds
@pytest.mark.parametrize("distance", [0.3, 1e-3, 1e-6])
def test_somigliana_gives_the_field_inside_and_nothing_outside(distance: float, seed: int, material: Material) -> None:
    # Without the hole: beside an element lies the inside (left) or the outside (right) of a star-shaped polygon.
    vertices = draw_polygon(np.random.default_rng(seed), 7)
    model, mesh = mesh_body(make_polygon(vertices, material, order=3, elements=5))
    exact = make_polynomial(seed, 3, material)
    v = sample_field(exact, mesh)
    inside = place_inside(mesh, distance)
    if distance > 0.1:  # far enough inside to cross another side: take the way to the center instead
        center = np.mean(vertices)
        inside = center + np.array([0.0, 0.1, 0.3, 0.4])[:, None] * np.exp(2j * np.arange(4)) * 0.4
        inside = inside.ravel()
    size = np.abs(v[: 2 * mesh.nodes]).max()
    stress = np.abs(v[2 * mesh.nodes :]).max()
    np.testing.assert_allclose(
        evaluate_inside(model, mesh, v, inside, None), exact.displacement(inside), rtol=0, atol=2e-13 * size
    )
    # The second derivative of the logarithm: rounding of the displacements over the distance to the nearest node.
    for normal in (1.0, 1j, np.exp(0.4j)):
        np.testing.assert_allclose(
            evaluate_inside(model, mesh, v, inside, normal), exact.traction(inside, normal), rtol=0, atol=1e-11 * stress
        )
    if distance < 0.1:
        outside = place_inside(mesh, -distance)
        assert np.abs(evaluate_inside(model, mesh, v, outside, None)).max() < 2e-13 * size
        assert np.abs(evaluate_inside(model, mesh, v, outside, 1j)).max() < 1e-11 * stress


def test_nothing_is_felt_far_outside() -> None:
    model, mesh = mesh_body(make_polygon(draw_polygon(np.random.default_rng(4), 7), order=3, elements=5))
    v = sample_field(make_polynomial(4, 3, ROCK), mesh)
    far = 10.0 ** np.array([1, 2, 4, 6]) * np.exp(1j * np.arange(4))
    assert np.abs(evaluate_inside(model, mesh, v, far, None)).max() < 1e-13 * np.abs(v[: 2 * mesh.nodes]).max()
    assert np.abs(evaluate_inside(model, mesh, v, far, 1.0)).max() < 1e-13 * np.abs(v[2 * mesh.nodes :]).max()
