"""Matrices of many small groups at once: those of the tangent operator, and of each group by itself to the last bit."""

from __future__ import annotations

import numpy as np
import pytest

from pbem.bem import hierarchical
from pbem.mesh.numbering import list_nodes, number_components
from pbem.solve.preconditioner.local_operator import Wanted
from pbem.solve.preconditioner.small_groups import SmallGroups
from pbem.solve.system import dense as dense_system
from tests.identities.solving import assemble_tangent
from tests.unit.far_sample import TEXTS
from tests.unit.test_schwarz import assemble, constrain, draw_modes

# Each with its own elements: more than one region, single elements, and many that are far from each other.
SHARES = (0.1, 0.4, 0.05, 0.2, 0.02, 0.3)


@pytest.mark.parametrize("name", TEXTS)
def test_they_are_rows_and_columns_of_the_tangent_operator(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """In statuses that are drawn, against the operator that is assembled as a whole."""
    for module in (dense_system, hierarchical):
        monkeypatch.setattr(module, "find_rigid_motions", lambda mesh, finite, needed: ())
    problem = assemble(name)
    mesh, random = problem.mesh, np.random.default_rng(11)
    modes = draw_modes(problem, 5)
    constraints = constrain(problem, modes)
    preconditioner = problem.make_tangent().preconditioner
    preconditioner.update(constraints)
    near, less, local = preconditioner._near, preconditioner._less, preconditioner._local
    exact = assemble_tangent(assemble(name, "dense"), modes)
    small, wanted = SmallGroups(mesh, local), []
    for share in SHARES:
        elements = np.flatnonzero(random.random(mesh.elements) < share)
        if not small.suit(elements) or not len(elements):
            continue
        places = near.find(number_components(list_nodes(mesh, elements)))
        # Of some elements no unknowns are left, as of those that stick.
        moving = np.repeat(random.random(len(elements)) < 0.7, len(places) // len(elements))
        rows = np.flatnonzero(random.random(len(places)) < 0.7)
        left = np.flatnonzero(moving & (random.random(len(places)) < 0.6))
        wanted.append(Wanted(elements, places, rows, left))
    # Regions that anchors hold have none.
    plain = {int(region) for region in np.unique(mesh.region) if local.is_plain(int(region))}
    assert len(wanted) >= 4 or len(plain) < len(np.unique(mesh.region))
    order = np.argsort(near.find(np.arange(2 * mesh.nodes)))
    for each, formed in zip(wanted, small.form(wanted, near, less) if wanted else [], strict=True):
        np.testing.assert_array_equal(formed, local.form(each, near, less))
        turned = less.turn @ exact[order].reshape(mesh.nodes, 2, -1)
        expected = turned.reshape(exact.shape)[each.places[each.rows]][:, order[each.places[each.left]]]
        np.testing.assert_allclose(formed, expected, rtol=0, atol=1e-11 * np.abs(exact).max())
