"""Stresses along faces from displacements: of regions alike or not; on elements of order 0 by differences that stop at
corners."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbem.bem.hoop import evaluate_stretch
from pbem.bem.particular_solution import ParticularSolution
from pbem.case.build import parse_model
from pbem.mesh.generate import generate_mesh
from pbem.mesh.mesh import Mesh, list_faces
from pbem.results.hoop_stress import HoopStress
from tests.identities.bodies import ROCK, Body, mesh_body
from tests.unit.results_sample import make_step

TILT = np.exp(0.4j)


def mesh_polygon(elements: int, grading: str = "none", backwards: bool = False) -> Mesh:
    """A body whose whole outline is one curve with four corners, far from the origin."""
    corners = [(300 + 200j) + TILT * corner for corner in (0j, 3 + 0j, 3 + 1j, 0.5 + 2j, 0j)]
    if backwards:
        corners.reverse()
    body = Body(curves={"outline": corners}, regions={"block": (ROCK, ["outline"])},
                order=0, elements=elements, grading=grading)  # fmt: skip
    return mesh_body(body)[1]


@pytest.mark.parametrize("grading", ["none", "both"])
@pytest.mark.parametrize("backwards", [False, True])
def test_strains_are_exact_up_to_the_corners_within_a_curve(grading: str, backwards: bool) -> None:
    mesh = mesh_polygon(6, grading, backwards)
    place = mesh.position - mesh.position.mean()
    displacement = 0.003 * place + (0.001 - 0.002j) * np.conj(place)
    stretch, direction = evaluate_stretch(mesh, displacement)
    exact = 0.003 * direction + (0.001 - 0.002j) * np.conj(direction)
    np.testing.assert_allclose(stretch, exact, rtol=0, atol=1e-11)


def test_an_element_alone_between_corners_has_the_differences_to_its_neighbours() -> None:
    mesh = mesh_polygon(1)
    assert mesh.elements == 4
    place = mesh.position - mesh.position.mean()
    stretch, direction = evaluate_stretch(mesh, 1e-3 * place)
    # A chord between the middles of two legs is shorter than the way along these.
    assert np.all((np.conj(direction) * stretch).real > 0.2e-3)
    assert np.all(np.abs(stretch) < 1.2e-3)


def test_differences_go_on_where_a_closed_curve_begins() -> None:
    body = Body(curves={"rim": (1 + 2j, 0.5)}, regions={"disc": (ROCK, ["rim"])}, circles=frozenset({"rim"}),
                order=0, elements=40)  # fmt: skip
    mesh = mesh_body(body)[1]
    stretch, direction = evaluate_stretch(mesh, 0.002 * mesh.position)
    # Of middles on a circle, h apart by the arc: sin(h) / h of the derivative, as everywhere.
    angle = 2 * np.pi / mesh.elements
    np.testing.assert_allclose(stretch, 0.002 * np.sin(angle) / angle * direction, rtol=1e-9)


# Free to grow; two of one material, the third of another.
THREE = """
[materials]
rock = { young = 3e3, poisson = 0.2, expansion = 1e-5 }
steel = { young = 2e5, poisson = 0.3, expansion = 2e-5 }
[curves]
one = { points = [[0, 0], [2, 0], [2, 1], [0, 1], [0, 0]], elements = 12 }
two = { points = [[3, 0], [5, 1], [4, 2], [3, 0]], elements = 9 }
other = { points = [[6, 0], [8, 0.5], [7, 2], [6, 0]], elements = 9 }
[regions]
one = { material = "rock", boundary = ["one"] }
two = { material = "rock", boundary = ["two"] }
other = { material = "steel", boundary = ["other"] }
"""
# Of the first and second one in each stage: alike, unlike, alike again, unlike the other way round; and all at rest,
# where nothing but their material distinguishes them.
TEMPERATURES = ((50.0, 50.0), (50.0, 20.0), (30.0, 30.0), (-10.0, 0.0), (0.0, 0.0))


@pytest.mark.parametrize("order", [1, 2])
def test_regions_are_taken_as_one_for_as_long_as_they_swell_alike(order: int) -> None:
    """Each grows freely and has a uniform stress of its own, whose part along the boundary is found in every stage."""
    stages = "".join(f"[[stages]]\ntemperature = {{ one = {one}, two = {two}, other = {one} }}\n"
                     for one, two in TEMPERATURES)  # fmt: skip
    model = parse_model(f"{THREE}[analysis]\norder = {order}\n{stages}")[1]
    mesh = generate_mesh(model)
    faces, hoop_stress = list_faces(mesh), HoopStress(model, mesh)
    position, along = faces.position, 1j * faces.normal
    stresses = np.array([(1.0, -0.5, 0.2), (-0.3, 0.4, 0.7), (2.0, 0.1, -0.6)])
    for stage, (one, two) in enumerate(TEMPERATURES):
        displacement, traction, expected = np.zeros((3, len(position)), dtype=complex)
        for number, temperature in enumerate((one, two, one)):
            own, material = faces.region == number, model.regions[number].material
            uniform = ParticularSolution(material, remote=tuple(stresses[number]))
            grown = (1 + material.poisson) * (2e-5 if number == 2 else 1e-5) * temperature  # plane strain
            displacement[own] = uniform.displacement(position[own]) + grown * position[own]
            traction[own] = uniform.traction(position[own], faces.normal[own])
            expected[own] = (np.conj(along[own]) * uniform.traction(position[own], along[own])).real
        step = replace(make_step(mesh, stage + 1, stage, 1.0, 1.0), displacement=displacement, traction=traction)
        np.testing.assert_allclose(hoop_stress.evaluate(step), expected.real, rtol=0, atol=1e-9)
