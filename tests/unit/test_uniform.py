"""Arrays whose values are all alike are stored once, and nothing else is."""

from __future__ import annotations

import gc
import tracemalloc

import numpy as np
import pytest

from pbem.contact.laws import collect_laws
from pbem.contact.loads import collect_outer_nodes, evaluate_load
from pbem.mesh.generate import generate_mesh
from pbem.mesh.mesh import list_faces
from pbem.results.energy import EnergyBalance
from pbem.uniform import fold_uniform, is_nothing, repeat_value, share_equal
from tests.unit.case_sample import build

FIELD = """
[materials.rock]
young = 2.0e4
poisson = 0.25
[regions.rock]
material = "rock"
infinite = true
[remote]
syy = -1.0
sxy = 0.2
[[generate]]
kind = "cracks"
name = "crack"
region = "rock"
count = 12
elements = 6
half_length = 0.8
distance = 0.1
box = [0, 0, 12, 12]
friction = 0.5
[analysis]
steps = 1
"""


@pytest.mark.parametrize("values", [
    np.full(7, 0.1), np.zeros((3, 2)), np.full(5, np.nan), np.full(4, 1 - 2j), np.ones(6, dtype=bool), np.full(4, 7),
    np.full((2, 3), 1.5).T,
])  # fmt: skip
def test_what_is_alike_takes_no_room(values: np.ndarray) -> None:
    folded = fold_uniform(values)
    assert not any(folded.strides)
    assert folded.dtype == values.dtype
    assert np.ascontiguousarray(folded).tobytes() == np.ascontiguousarray(values).tobytes()
    with pytest.raises(ValueError, match="read-only"):
        folded[...] = values


@pytest.mark.parametrize("values", [
    np.array([0.0, -0.0]), np.array([1.0, np.nan]), np.array([0.1, np.nextafter(0.1, 1)]), np.array([1j, 1]),
    np.array([True, False]), np.array([3, 4]), np.zeros(0), np.array([5.0]),
])  # fmt: skip
def test_what_differs_in_a_bit_stays(values: np.ndarray) -> None:
    assert fold_uniform(values) is values


def test_repeated_values_are_those_of_full_arrays() -> None:
    assert np.array_equal(repeat_value(2.5, (3, 2)), np.full((3, 2), 2.5))
    assert repeat_value(0.0, 4, complex).dtype == complex
    assert repeat_value(0.0, 0).shape == (0,)


def measure(item: object) -> int:
    """Bytes of the arrays of an object that take room."""
    arrays = [each for each in vars(item).values() if isinstance(each, np.ndarray)]
    return sum(each.nbytes for each in arrays if any(each.strides))


def test_laws_and_loads_of_alike_cracks_take_little_room() -> None:
    """Of pairs in one crack, those that depend on the place are left: stiffness, leader, and the field far away."""
    model = build(FIELD)
    mesh = generate_mesh(model)
    laws = collect_laws(model, mesh)
    assert measure(laws) <= 8 * 3 * laws.count
    assert all(not any(each.strides) for group in laws.strengths for each in group.parameters.values())
    load = evaluate_load(model, mesh, collect_outer_nodes(model, mesh), 0, 0.5)
    # The field far away: displacement and traction; nothing else is there.
    assert measure(load) <= 16 * 3 * mesh.nodes
    assert not load.known.any()


def test_the_energy_balance_stores_no_fields_of_its_own() -> None:
    """Neither the unit fields, which take 96 bytes for each of three stresses on a face, nor places and normals of
    faces, 77 bytes, nor what is zero."""
    model = build(FIELD.replace("count = 12", "count = 150").replace("12, 12", "50, 50"))
    mesh = generate_mesh(model)
    EnergyBalance(model, mesh)  # what the model and the mesh keep by themselves is there
    gc.collect()
    tracemalloc.start()
    balance = EnergyBalance(model, mesh)
    now, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    count = len(list_faces(mesh).weight)
    assert now < 45 * count
    assert most < 400 * count
    assert balance.laws.count == mesh.pairs.count


def test_nothing_is_a_zero_that_stands_for_all() -> None:
    assert is_nothing(repeat_value(0.0, 5, complex))
    assert not is_nothing(repeat_value(1e-300, 5)) and not is_nothing(np.zeros(5))


def test_arrays_of_the_same_bits_are_one() -> None:
    values, same = np.array([0.1, np.nan, -0.0]), np.array([0.1, np.nan, -0.0])
    other, longer, single = np.array([0.1, np.nan, 0.0]), np.arange(4.0), values.astype(np.float32)
    assert share_equal(values, longer, single, other, same) is same
    assert share_equal(values, longer, single, other) is values
    assert share_equal(repeat_value(3, 4, int), np.full(4, 3)).strides == (8,)
    assert share_equal(values) is values
