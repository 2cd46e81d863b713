"""Derivatives of displacements along faces, on elements of order 0: differences that stop at corners."""

from __future__ import annotations

import numpy as np
import pytest

from pbem.bem.hoop import evaluate_stretch
from pbem.mesh.mesh import Mesh
from tests.identities.bodies import ROCK, Body, mesh_body

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
