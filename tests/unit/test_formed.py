"""Arrays whose values are formed for the places that are asked for: they are the arrays that they stand for."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from dataclasses import fields
from operator import iadd, setitem
from typing import Any

import numpy as np
import pytest

from pbem import formed
from pbem.case.build import read_model
from pbem.contact.laws import collect_laws, start_memory
from pbem.formed import FormedArray, form_runs, form_values
from pbem.mesh.generate import generate_mesh
from pbem.solve.system.kept import digest
from tests.cases.bundled import CASES
from tests.parallel.held_arrays import list_arrays
from tests.unit.case_sample import build
from tests.unit.test_mesh_memory import MIXED
from tests.unit.test_uniform import FIELD

ARRAYS: dict[str, np.ndarray] = {
    "numbers": np.arange(20_000),
    "runs of numbers, up and down": np.concatenate([np.arange(9000), np.arange(700, 4000)[::-1], np.arange(5, 90)]),
    "equal neighbours": np.repeat(np.array([0.5, -0.0, 3.5, np.nan, 0.5]), [4000, 300, 5000, 1, 20]),
    "two numbers by turns, then equal ones": np.concatenate([np.tile([3, 4], 40), np.full(9000, 7)]),
    "truth": np.repeat([True, False, True], [3, 9000, 1]),
}


@pytest.fixture(autouse=True)
def _form_all(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(formed, "LARGE", 1)


@pytest.mark.parametrize("values", ARRAYS.values(), ids=ARRAYS.keys())
def test_runs_are_the_array_that_they_stand_for(values: np.ndarray) -> None:
    found: Any = form_runs(values)
    assert isinstance(found, FormedArray) and (len(found), found.shape, found.dtype) == (
        len(values), values.shape, values.dtype)
    random = np.random.default_rng(2).integers(-len(values), len(values), (7, 5))
    keys = (random, random[0], random[:0, 0], slice(None), slice(9, -3, 4), slice(None, None, -1), values == values[0],
            5, -1, np.int64(3), (random, None), (slice(2, 5), None), ..., np.abs(random).tolist())  # fmt: skip
    for key in keys:
        assert np.asarray(found[key]).tobytes() == np.asarray(values[key]).tobytes(), key
    for copied in (pickle.loads(pickle.dumps(found)), copy.deepcopy(found)):
        assert np.asarray(copied).tobytes() == values.tobytes()
    assert sum(each.nbytes for each in list_arrays(found, set())) < 0.3 * values.nbytes
    assert digest(found) == digest(values)
    # Whatever else arrays do it does as the whole.
    uses: tuple[Callable[[Any], Any], ...] = (
        lambda v: v == values[3], lambda v: np.where(v > 0, v, 1), lambda v: 2.0 * v, lambda v: v.sum(),
        lambda v: np.concatenate([v, values]), lambda v: v.astype(float) @ np.ones(len(v)),
        lambda v: np.bincount(np.zeros(len(v), dtype=int), v), lambda v: v.copy(), lambda v: list(v)[-1], np.unique,
    )  # fmt: skip
    for use in uses:
        np.testing.assert_array_equal(use(found), use(values))


def test_places_that_there_are_none_of_are_refused() -> None:
    found: Any = form_runs(np.arange(40))
    for key in (40, -41, np.array([3, 40]), np.array([-41])):
        with pytest.raises(IndexError):
            found[key]


def test_nothing_is_written_to_what_is_not_stored() -> None:
    """It would be lost without a word."""
    found: Any = form_runs(np.arange(40))
    uses: dict[str, Callable[[], Any]] = {
        "to a place": lambda: setitem(found, 3, 1), "in place": lambda: iadd(found, 1),
        "out": lambda: np.add(found, 1, out=found), "at": lambda: np.add.at(found, [0], 1),
        "fill": lambda: found.fill(0), "sort": lambda: found.sort(), "copyto": lambda: np.copyto(found, 1),
    }  # fmt: skip
    for name, use in uses.items():
        with pytest.raises((TypeError, ValueError)):
            pytest.fail(f"{name}: {use()}")
    assert (np.asarray(found) == np.arange(40)).all()
    assert found.copy().flags.writeable


def test_values_that_would_be_others_stay_as_they_are() -> None:
    values = np.linspace(0.0, 1.0, 20_000)
    assert isinstance(form_values(values, lambda places: values[places]), FormedArray)
    other = values.copy()
    other[0] = -0.0
    for form in (lambda places: other[places], lambda places: values[places].astype(np.float32)):
        assert form_values(values, form) is values
    assert form_runs(values) is values
    signs = np.repeat([0.0, -0.0], 10_000)
    assert form_runs(signs) is signs
    uneven = np.random.default_rng(1).integers(0, 9, 20_000)
    assert form_runs(uneven) is uneven
    assert form_runs(np.zeros(0, dtype=int)).shape == (0,)


def test_small_arrays_are_stored(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(formed, "LARGE", 90)
    fewer = np.arange(89)
    assert form_runs(fewer) is fewer
    assert isinstance(form_runs(np.arange(90)), FormedArray)


# An arc, and a crack of two legs, one of them straight.
CURVED = """
materials.m = { young = 1e3, poisson = 0.3 }
curves.arc = { center = [0, 0], radius = 1.0, angles = [0, 90], elements = 7 }
curves.bent = { points = [[3, 0], [4, 0.5], [5, 0.5]], elements = [5, 6] }
regions.plane = { material = "m", infinite = true, cracks = ["arc", "bent"] }
remote = { sxx = -1.0, syy = -3.0 }
"""
TEXTS = {"cracks": FIELD, "an interface and cracks": MIXED, "arcs": CURVED}
NAMES = ("crack_field", "two_blocks_hst", "panel_friction_closing")


@pytest.mark.parametrize("name", [*TEXTS, *NAMES])
def test_meshes_and_laws_are_the_same(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """To the last bit, whatever the curves are."""
    model = build(TEXTS[name]) if name in TEXTS else read_model(CASES[name])[1]
    mesh = generate_mesh(model)
    laws = collect_laws(model, mesh)
    monkeypatch.setattr(formed, "LARGE", 10**9)
    plain = generate_mesh(model)
    expected = collect_laws(model, plain)
    pairs = [(mesh, plain), (mesh.pairs, plain.pairs), (mesh.links, plain.links), (laws, expected),
             *zip(laws.strengths, expected.strengths, strict=True)]
    for one, two in pairs:
        for each in fields(two):
            values = getattr(two, each.name)
            if isinstance(values, np.ndarray):
                assert np.asarray(getattr(one, each.name)).tobytes() == values.tobytes(), each.name
    assert digest(start_memory(laws)) == digest(start_memory(expected))
    assert digest(mesh) == digest(plain)


@pytest.mark.parametrize("name", [*TEXTS])
def test_values_do_not_depend_on_what_is_formed_with_them(name: str) -> None:
    """To the last bit: ranks that ask for a node alone, or with others, take the same place for it."""
    mesh = generate_mesh(build(TEXTS[name].replace("elements = 7", "elements = 70")))
    formed_alone = 0
    for item in (mesh, mesh.pairs):
        for each in fields(item):
            found = getattr(item, each.name)
            if isinstance(found, FormedArray):
                formed_alone += 1
                for some in range(1, 8):
                    parts = [found[begin : begin + some] for begin in range(0, len(found), some)]
                    assert np.concatenate(parts).tobytes() == np.asarray(found).tobytes(), (each.name, some)
                apart = np.arange(len(found) // 3 * 3).reshape(-1, 3)[::-1, ::2]
                assert found[apart].tobytes() == np.asarray(found)[apart].tobytes(), each.name
    assert formed_alone > 3


def test_of_arcs_values_are_stored_and_formed_of_the_rest() -> None:
    straight = CURVED.replace("elements = [5, 6]", "elements = [50, 60]")
    mesh = generate_mesh(build(straight))
    for found in (mesh.position, mesh.normal, mesh.weight, mesh.pairs.arc_length):
        assert isinstance(found, FormedArray)
        stored = [each.size for each in list_arrays(found, set()) if each.size == 21]
        assert len(stored) >= 2  # places and values of three nodes on seven arcs


def test_of_cracks_little_more_than_the_ends_of_elements_is_stored() -> None:
    model = build(FIELD.replace("count = 12", "count = 100").replace("12, 12", "42, 42"))
    mesh = generate_mesh(model)
    laws = collect_laws(model, mesh)

    def measure(item: object) -> int:
        return sum(each.nbytes for each in list_arrays(item, set()))

    # Ends, and the length of the curve before each element: 40 bytes for 3 nodes; runs of each curve.
    assert measure(mesh) < 9 * 2 * mesh.nodes
    assert measure((mesh, laws)) - measure(mesh) < 2 * 2 * mesh.nodes
    assert mesh.pairs.position is mesh.position and mesh.pairs.first is mesh.pairs.second is mesh.pairs.slave
