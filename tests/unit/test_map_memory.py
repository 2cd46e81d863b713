"""What is made for a moment on every rank while a constraint map is built and unknowns are carried over."""

from __future__ import annotations

import gc
import tracemalloc

import numpy as np
import pytest

from pbem.contact import modes as contact_modes
from pbem.contact.constraints import ConstraintMap
from pbem.contact.laws import OPEN, SLIP, STICK, ModeState, collect_laws, start_memory
from pbem.contact.loads import collect_outer_nodes, evaluate_load
from pbem.contact.modes import Linearisation, carry_over, linearise
from pbem.mesh.generate import generate_mesh
from pbem.mesh.mesh import Mesh
from pbem.model.model import Model
from tests.unit.case_sample import build
from tests.unit.test_uniform import FIELD

SCALE = 2.0e3


def draw(model: Model, mesh: Mesh, seed: int) -> Linearisation:
    """The laws of pairs in modes that are drawn."""
    laws, random = collect_laws(model, mesh), np.random.default_rng(seed)
    memory, zeros = start_memory(laws), np.zeros(laws.count)
    drawn = random.choice([STICK, SLIP, OPEN], laws.count).astype(np.int8)
    state = ModeState(drawn, random.choice([-1.0, 1.0], laws.count))
    return linearise(laws, state, zeros - 1.0, zeros, memory, zeros, SCALE)


@pytest.fixture(scope="module")
def field() -> tuple[Model, Mesh]:
    model = build(FIELD.replace("count = 12", "count = 150").replace("12, 12", "50, 50"))
    return model, generate_mesh(model)


def test_a_map_takes_little_more_room_while_it_is_built(field: tuple[Model, Mesh]) -> None:
    model, mesh = field
    outer, law = collect_outer_nodes(model, mesh), draw(model, mesh, 1)
    load, gap = evaluate_load(model, mesh, outer, 0, 1.0), np.zeros(mesh.pairs.count)
    gc.collect()
    tracemalloc.start()
    built = ConstraintMap(mesh, outer, gap, law, load, SCALE)
    matrix, offset = built.matrix, built.offset
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    size = sum(each.nbytes for each in (matrix.data, matrix.indices, matrix.indptr, offset))
    assert most < 3.0 * size


def test_unknowns_are_carried_over_some_pairs_at_a_time(
    field: tuple[Model, Mesh], monkeypatch: pytest.MonkeyPatch
) -> None:
    model, mesh = field
    before, after = (draw(model, mesh, seed) for seed in (2, 3))
    unknowns = np.random.default_rng(4).standard_normal((mesh.pairs.count, 2))
    state = np.einsum("mij,mj->mi", before.tangent, unknowns) + before.offset
    whole = carry_over(state, after, SCALE)
    # What a pair's mode keeps it keeps exactly: back and forth in the same modes nothing changes.
    assert np.allclose(carry_over(state, before, SCALE), unknowns, rtol=1e-9, atol=1e-9)
    monkeypatch.setattr(contact_modes, "SOLVED", mesh.pairs.count // 2 - 1)  # the third part is small
    assert np.array_equal(carry_over(state, after, SCALE), whole)
