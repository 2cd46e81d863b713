"""A body that turns as a whole is not strained: B of its rotation is zero on arcs and for constant elements, too."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
import pytest

import pbem
from pbem.case.build import parse_model
from pbem.mesh.generate import generate_mesh
from pbem.parallel import world
from pbem.solve.problem.problem import Problem
from pbem.solve.system.assembly import assemble_problem

pytestmark = pytest.mark.usefixtures("without_errors")

# A disc that fits tightly into a plate that is pulled: it touches along two arcs, on which it can slide round.
DISC = """
[materials]
rock = {{ young = 1.4e3, poisson = 0.4, plane = "stress" }}
grain = {{ young = 5.4e2, poisson = 0.26 }}
[curves]
bottom = {{ points = [[-1, -1], [1, -1]], elements = 6 }}
right = {{ points = [[1, -1], [1, 1]], elements = 6 }}
top = {{ points = [[1, 1], [-1, 1]], elements = 6 }}
left = {{ points = [[-1, 1], [-1, -1]], elements = 6 }}
hole = {{ center = [0.1, 0.05], radius = 0.4, elements = 14 }}
[regions]
disc = {{ material = "grain", boundary = ["hole"] }}
plate = {{ material = "rock", boundary = ["bottom", "right", "top", "left", "hole"] }}
[interfaces]
hole = {{ law = "coulomb", friction = 0.2 }}
[boundary]
bottom = {{ un = 0.0, us = 0.0 }}
top = {{ un = 0.01, us = {shear} }}
[analysis]
scheme = "{scheme}"
order = {order}
"""


def assemble(order: int, scheme: str, operator: Literal["dense", "hierarchical"]) -> Problem:
    model = parse_model(DISC.format(shear=0.0, scheme=scheme, order=order))[1]
    model = replace(model, solver=replace(model.solver, operator=operator))
    return assemble_problem(model, generate_mesh(model), world)


@pytest.mark.parametrize("operator", ["dense", "hierarchical"])
@pytest.mark.parametrize("scheme", ["SST", "DBEM"])
@pytest.mark.parametrize("order", [0, 1, 2])
def test_the_operator_of_a_rotation_is_zero(
    order: int, scheme: str, operator: Literal["dense", "hierarchical"]
) -> None:
    problem = assemble(order, scheme, operator)
    mesh = problem.mesh
    for region in range(2):
        # About a point far away: translations are represented in any case.
        u = np.where(mesh.node_region == region, 1j * (mesh.position - (3.0 - 2.0j)), 0.0)
        v = np.concatenate([u, np.zeros(mesh.nodes)])
        rows = problem.system.apply(np.stack([v.real, v.imag], axis=1).ravel())
        limit = 1e-9 if operator == "hierarchical" else 1e-13
        np.testing.assert_allclose(rows, 0.0, atol=limit * np.abs(u).max())


@pytest.mark.parametrize("operator", ["dense", "hierarchical"])
@pytest.mark.parametrize("scheme", ["SST", "DBEM", "HST"])
def test_translations_leave_nothing_on_short_elements(
    scheme: str, operator: Literal["dense", "hierarchical"]
) -> None:
    """Integrals over elements of 2e-6 of the radius are known to 1e-11, their sums to the rounding of sums."""
    hole = "hole = {{ center = [0.1, 0.05], radius = 0.4, elements = 14 }}"
    parts = "".join(
        f"{name} = {{{{ center = [0.1, 0.05], radius = 0.4, angles = {angles}, elements = {count} }}}}\n"
        for name, angles, count in (("hole", [70.0005, 430.0], 14), ("chip", [70.0, 70.0005], 4))
    )
    text = DISC.replace(hole, parts).replace('"hole"]', '"hole", "chip"]')
    text = text.replace("[boundary]", 'chip = {{ law = "coulomb", friction = 0.2 }}\n[boundary]')
    model = parse_model(text.format(shear=0.0, scheme=scheme, order=1))[1]
    model = replace(model, solver=replace(model.solver, operator=operator))
    problem = assemble_problem(model, generate_mesh(model), world)
    mesh = problem.mesh
    assert np.abs(mesh.end - mesh.start).min() < 1e-6
    for direction in (1.0, 1j):
        v = np.concatenate([np.where(mesh.node_region == 0, direction, 0.0), np.zeros(mesh.nodes)])
        rows = problem.system.apply(np.stack([v.real, v.imag], axis=1).ravel())
        np.testing.assert_allclose(rows, 0.0, atol=2e-13)


@pytest.mark.parametrize(("order", "limit"), [(0, 1e-9), (1, 1e-2)])
def test_a_disc_that_slides_in_its_hole_carries_no_moment(order: int, limit: float, tmp_path: Path) -> None:
    """Its mesh does not hold it: constant elements did, with a moment of 0.6 of the friction times the radius."""
    case = tmp_path / "disc.toml"
    case.write_text(DISC.format(shear=0.004, scheme="SST", order=order))
    found = pbem.run(case, tmp_path / "disc.h5")
    hole = found.contact["hole"]
    p_s = hole.traction_s[-1]
    assert (hole.mode[-1] == 2).any() and (hole.mode[-1] == 1).any(), "parts and slips"
    # All nodes have the same weight on elements of one length with one or two nodes.
    assert abs(p_s.sum()) < limit * np.abs(p_s).sum()
