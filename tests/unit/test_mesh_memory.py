"""What the mesh takes on every rank: what it keeps, and what is made for a moment while it is generated."""

from __future__ import annotations

import gc
import pickle
import tracemalloc

import numpy as np
import pytest

from pbem.contact.laws import collect_laws
from pbem.mesh import generate, pairing
from pbem.mesh.generate import generate_mesh
from pbem.mesh.mesh import Mesh
from tests.parallel.held_arrays import list_arrays
from tests.unit.case_sample import build
from tests.unit.test_uniform import FIELD

# An interface with cracks on either side of it.
MIXED = """
materials.m = { young = 1e3, poisson = 0.3 }
materials.n = { young = 2e3, poisson = 0.2 }
curves.low = { points = [[0, 0], [0, -2], [4, -2], [4, 0]], elements = [3, 4, 5] }
curves.seat = { points = [[4, 0], [0, 0]], elements = 6 }
curves.high = { points = [[4, 0], [4, 2], [0, 2], [0, 0]], elements = [3, 4, 5] }
curves.left = { points = [[1, -1], [1.5, -1.2], [2, -1]], elements = [3, 5] }
curves.right = { points = [[2.5, 1], [3, 1.3]], elements = 4 }
regions.one = { material = "m", boundary = ["low", "seat"], cracks = ["left"] }
regions.two = { material = "n", boundary = ["high", "seat"], cracks = ["right"] }
interfaces.seat = { law = "coulomb", friction = 0.4 }
boundary.low = { ux = 0.0, uy = 0.0 }
boundary.high = { ty = -1.0 }
"""


def measure(item: object) -> int:
    """Bytes of all arrays that an object holds."""
    return sum(each.nbytes for each in list_arrays(item, set()))


def generate_field() -> tuple[Mesh, int]:
    """The mesh of 300 cracks, and the bytes of all that there was at once while it was generated."""
    model = build(FIELD.replace("count = 12", "count = 300").replace("12, 12", "71, 71"))
    generate_mesh(model)  # what is found once is there
    gc.collect()
    tracemalloc.start()
    mesh = generate_mesh(model)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return mesh, most


def test_the_mesh_of_cracks_keeps_nothing_twice_and_little_is_made_beside_it() -> None:
    mesh, most = generate_field()
    pairs, unknowns = mesh.pairs, 2 * mesh.nodes
    # Places, normals, weights of nodes; ends of elements; interface, node and place along the crack of pairs.
    assert measure(mesh) < 44 * unknowns
    assert pairs.position is mesh.position and pairs.normal is mesh.normal and pairs.weight is mesh.weight
    assert pairs.first is pairs.second is pairs.slave
    # Objects of Python, six elements on each crack.
    assert most < 150 * unknowns
    assert np.array_equal(pairs.first, np.arange(mesh.nodes))
    assert pairs.crack.all() and (pairs.sense == -1).all() and not pairs.distance.any()


def test_laws_of_cracks_take_little_beside_the_mesh() -> None:
    model = build(FIELD)
    mesh = generate_mesh(model)
    laws = collect_laws(model, mesh)
    assert laws.leader is mesh.pairs.first
    assert not laws.follows.any()


def test_pairs_of_cracks_and_interfaces_lie_at_their_nodes(monkeypatch: pytest.MonkeyPatch) -> None:
    """However many curves are put together at a time; of interfaces the second side follows the first."""
    model = build(MIXED)
    found = []
    for joined in (256, 1, 2):
        monkeypatch.setattr(generate, "JOINED", joined)
        monkeypatch.setattr(pairing, "JOINED", joined)
        found.append(generate_mesh(model))
    mesh, pairs = found[0], found[0].pairs
    assert len(mesh.interface_names) == 3
    expected = np.array([mesh.interface_names.index(name) for name in ("seat", "left", "right")])
    assert (np.bincount(pairs.interface)[expected] >= [18, 24, 12]).all()  # meshes may be finer than asked for
    assert np.array_equal(pairs.crack, pairs.interface != mesh.interface_names.index("seat"))
    assert np.array_equal(pairs.crack, pairs.first == pairs.second)
    assert np.array_equal(pairs.slave, pairs.second)
    assert np.array_equal(pairs.sense, np.where(pairs.crack, -1.0, 1.0))
    for name in ("position", "weight"):
        np.testing.assert_allclose(getattr(pairs, name), getattr(mesh, name)[pairs.first], rtol=1e-14)
        np.testing.assert_allclose(getattr(pairs, name), getattr(mesh, name)[pairs.second], rtol=1e-14)
    np.testing.assert_allclose(pairs.normal, mesh.normal[pairs.first], rtol=1e-14)
    np.testing.assert_allclose(mesh.normal[pairs.second][~pairs.crack], -pairs.normal[~pairs.crack], rtol=1e-14)
    for name, length in (("seat", 4.0), ("left", 2 * np.hypot(0.5, 0.2)), ("right", np.hypot(0.5, 0.3))):
        own = pairs.interface == mesh.interface_names.index(name)
        assert np.isclose(pairs.weight[own].sum(), length, rtol=1e-14)
        assert (np.diff(pairs.arc_length[own]) > 0).all() and 0 < pairs.arc_length[own][0] < 0.2 * length
    for other in found[1:]:
        for one, two in ((mesh, other), (pairs, other.pairs), (mesh.links, other.links)):
            for name, values in vars(one).items():
                if isinstance(values, np.ndarray):
                    np.testing.assert_array_equal(vars(two)[name], values, err_msg=name)


def test_a_crack_of_a_model_that_was_sent_takes_a_kilobyte() -> None:
    """Every rank has the model as it comes from the first one; names, ends, divisions and tips of each crack."""
    model = build(FIELD.replace("count = 12", "count = 300").replace("12, 12", "71, 71"))
    generate_mesh(model)  # nothing that it finds is sent along
    sent = pickle.dumps(model, pickle.HIGHEST_PROTOCOL)
    pickle.loads(sent)
    gc.collect()
    tracemalloc.start()
    there = pickle.loads(sent)
    generate_mesh(there)
    gc.collect()
    kept = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert there.curves == model.curves
    assert len(sent) < 250 * 300 and kept < 900 * 300
