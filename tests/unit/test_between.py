"""Contact between the nodes: fields with known violations, and fields without."""

from __future__ import annotations

import numpy as np
import pytest

from pbem.case.build import parse_model
from pbem.contact.laws import SLIP
from pbem.mesh.generate import generate_mesh
from pbem.results.between import BetweenNodes
from pbem.solve.problem.step import ContactState, Step
from tests.cli.cli_sample import BLOCKS


def make_step(**fields: np.ndarray) -> Step:
    count = len(next(iter(fields.values())))
    zeros = np.zeros(count)
    contact = ContactState(
        mode=np.full(count, SLIP, dtype=np.int8),
        **{name: fields.get(name, zeros) for name in ("opening", "slip", "traction_n", "traction_s")},
        internal={"slip_path": fields.get("slip_path", zeros), "broken": np.zeros(count, dtype=bool)},
    )
    return Step(1, 0, 1.0, (), 0.0, np.zeros(0, complex), np.zeros(0, complex), contact)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e7])
def test_a_parabola_that_dips_between_two_nodes(scale: float) -> None:
    model = parse_model(BLOCKS)[1]
    mesh = generate_mesh(model)
    between = BetweenNodes(model, mesh)
    # (s - a) (s - b) with roots at the first two of the three Gauss points: least midway, -(b - a)^2/4
    s = np.tile(np.polynomial.legendre.leggauss(3)[0], 4)
    a, b = s[0], s[1]
    dip = scale * (s - a) * (s - b)
    found = between.find_violations(make_step(opening=dip))
    assert np.isclose(found.penetration[0], scale * (b - a) ** 2 / 4, rtol=1e-12)
    assert found.tension[0] == found.cone[0] == 0
    found = between.find_violations(make_step(traction_n=-dip))
    assert np.isclose(found.tension[0], scale * (b - a) ** 2 / 4, rtol=1e-12)
    assert found.penetration[0] == 0


def test_the_cone_is_that_of_friction() -> None:
    model = parse_model(BLOCKS)[1]
    mesh = generate_mesh(model)
    between = BetweenNodes(model, mesh)
    pressure = np.full(mesh.pairs.count, -10.0)
    s = np.tile(np.polynomial.legendre.leggauss(3)[0], 4)
    a, b = s[1], s[2]
    bulge = -(s - a) * (s - b)  # zero at two nodes, (b - a)^2/4 between them
    inside = between.find_violations(make_step(traction_n=pressure, traction_s=np.full(mesh.pairs.count, 2.0)))
    assert inside.cone[0] == pytest.approx(0.0, abs=1e-14)
    beyond = between.find_violations(make_step(traction_n=pressure, traction_s=2.0 + bulge))
    assert beyond.cone[0] == pytest.approx((b - a) ** 2 / 4, rel=1e-12)


def test_what_varies_is_read_between_the_nodes() -> None:
    """Open faces under a pressure that rises along them carry it between the nodes too; friction is that of the place,
    so that tractions on the cone of a friction coefficient that rises are on it everywhere."""
    assert "friction = 0.2" in BLOCKS
    model = parse_model(BLOCKS.replace("friction = 0.2", 'friction = { expression = "0.2 + 0.3*x" }'))[1]
    mesh = generate_mesh(model)
    x = mesh.position[mesh.pairs.first].real
    found = BetweenNodes(model, mesh).find_violations(
        make_step(traction_n=np.full(mesh.pairs.count, -10.0), traction_s=2.0 + 3.0 * x))
    assert found.cone[0] < 1e-12

    text = BLOCKS.replace("friction = 0.2", 'friction = 0.2\npressure = { expression = "2*x" }')
    model = parse_model(text)[1]
    mesh = generate_mesh(model)
    x = mesh.position[mesh.pairs.first].real
    found = BetweenNodes(model, mesh).find_violations(make_step(traction_n=-2 * x))
    assert found.tension[0] < 1e-12
