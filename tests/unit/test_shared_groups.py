"""Preconditioners of the shares of several ranks: together they are that of the whole, and each holds its share."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from pbem.contact.constraints import ConstraintMap
from pbem.contact.loads import collect_outer_nodes, evaluate_load
from pbem.mesh.generate import generate_mesh
from pbem.mesh.mesh import Mesh
from pbem.mesh.numbering import list_nodes, number_components
from pbem.parallel import world
from pbem.solve.preconditioner.schwarz import SchwarzPreconditioner
from pbem.solve.preconditioner.subdomains import divide_model, share_groups, surround_groups
from tests.parallel.held_arrays import list_arrays
from tests.unit.case_sample import build
from tests.unit.test_map_memory import SCALE, draw
from tests.unit.test_uniform import FIELD


class Shares:
    """A field of cracks, their map in statuses that are drawn, and the preconditioners of all ranks' groups of it."""

    def __init__(self) -> None:
        model = build(FIELD.replace("count = 12", "count = 400").replace("12, 12", "82, 82"))
        self.mesh: Mesh = generate_mesh(model)
        outer, gap = collect_outer_nodes(model, self.mesh), np.zeros(self.mesh.pairs.count)
        load = evaluate_load(model, self.mesh, outer, 0, 1.0)
        self.map: ConstraintMap = ConstraintMap(self.mesh, outer, gap, draw(model, self.mesh, 1), load, SCALE)
        self.materials = [region.material for region in model.regions]
        self.groups = divide_model(self.mesh)

    def make(self, ranks: int) -> Iterator[tuple[np.ndarray, SchwarzPreconditioner]]:
        """The nodes and the preconditioner of each of so many ranks."""
        for rank in range(ranks):
            first, last = share_groups(self.mesh, self.groups, rank, ranks)
            nodes = list_nodes(self.mesh, np.sort(np.concatenate(self.groups[first:last])))
            around = surround_groups(self.mesh, self.groups, first, last)
            made = SchwarzPreconditioner(world, self.mesh, self.materials, 1.0, (), around, nodes)
            made.update(self.map)
            yield nodes, made


@pytest.fixture(scope="module")
def shares() -> Shares:
    return Shares()


def test_shares_are_the_whole_and_hold_no_more_than_they_see(shares: Shares) -> None:
    mesh = shares.mesh
    residual, unknowns = np.random.default_rng(3).standard_normal(2 * mesh.nodes), 2 * mesh.nodes
    expected, whole = np.zeros(unknowns), 0
    for ranks in (1, 4):
        for nodes, made in shares.make(ranks):
            own = number_components(nodes)
            result = np.zeros(len(own))
            made.apply(residual[np.concatenate([own, number_components(made.beyond)])], result)
            turned = made.turn(residual[own])
            np.testing.assert_allclose(made.turn_back(turned), residual[own], rtol=0, atol=1e-12)
            # Beside the mesh, the groups and their inverses: of no array more than four shares of the unknowns.
            seen: set[int] = set()
            for apart in (mesh, made.inverses):
                list_arrays(apart, seen)
            arrays = list_arrays(made, seen)
            held = sum(each.nbytes for each in arrays)
            assert max(each.size for each in arrays) <= 4 * unknowns / ranks
            if ranks == 1:
                expected, whole = result, held
            np.testing.assert_allclose(result, expected[own], rtol=0, atol=1e-6 * np.abs(expected).max())
            assert held < 2 * whole / ranks
