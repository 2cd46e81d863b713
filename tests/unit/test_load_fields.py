"""Fields far away at some nodes are those of all nodes, and only these are stored."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pbem.case.build import parse_model
from pbem.contact.loads import Load, collect_outer_nodes, evaluate_load
from pbem.mesh.generate import generate_mesh
from pbem.mesh.mesh import Mesh
from pbem.model.model import Model
from tests.parallel.held_arrays import list_arrays
from tests.unit.case_sample import build
from tests.unit.far_sample import read_sample
from tests.unit.test_uniform import FIELD
from tests.verification.rigid_sample import UNMOVED, lay_bar

GALLERY = Path(__file__).resolve().parents[2] / "cases" / "gallery"
SXX, SYY, SXY = 0.3, -1.0, 0.2
GROUND = FIELD.replace("syy = -1.0", f"sxx = {SXX}\nsyy = {SYY}")

MODELS: dict[str, Callable[[], Model]] = {
    "cracks": lambda: build(GROUND),
    "inclusions": lambda: read_sample("inclusions HST"),
    "weight": lambda: parse_model((GALLERY / "gravity_dam.toml").read_text(encoding="utf-8"))[1],
    "tool": lambda: lay_bar(UNMOVED, "tool"),
}


def load_model(model: Model, factor: float = 1.0) -> tuple[Mesh, Load]:
    mesh = generate_mesh(model)
    return mesh, evaluate_load(model, mesh, collect_outer_nodes(model, mesh), 0, factor)


def test_tractions_far_away_are_those_of_the_stress_given() -> None:
    mesh, load = load_model(build(GROUND), 0.5)
    far, n = load.fields.take_far(np.arange(mesh.nodes)), mesh.normal
    exact = 0.5 * (SXX * n.real + SXY * n.imag + 1j * (SXY * n.real + SYY * n.imag))
    np.testing.assert_allclose(far[1], exact, rtol=0, atol=1e-14)


@pytest.mark.parametrize("name", MODELS)
def test_fields_of_some_nodes_are_those_of_all(name: str) -> None:
    model = MODELS[name]()
    mesh, load = load_model(model)
    far, particular = load.fields.list_all()
    assert far.any() == (name in ("cracks", "tool")) and particular.any() == (name in ("cracks", "weight"))
    gone = np.zeros(len(model.regions), dtype=bool)
    gone[-1] = len(gone) > 1
    removed = load.fields.without(gone)
    nothing = gone[mesh.node_region]
    for seed in (1, 2):
        nodes = np.sort(np.random.default_rng(seed).choice(mesh.nodes, mesh.nodes // 3, replace=False))
        np.testing.assert_array_equal(load.fields.take_far(nodes), far[:, nodes])
        np.testing.assert_array_equal(load.fields.take_particular(nodes), particular[nodes])
        np.testing.assert_array_equal(removed.take_far(nodes), np.where(nothing, 0.0, far)[:, nodes])
        np.testing.assert_array_equal(removed.take_particular(nodes), np.where(nothing, 0.0, particular)[nodes])


def test_a_share_of_the_nodes_takes_its_part_of_the_room() -> None:
    model = build(GROUND.replace("count = 12", "count = 40").replace("12, 12", "26, 26"))
    mesh, load = load_model(model)
    seen: set[int] = set()
    list_arrays((model, mesh), seen)

    def measure() -> int:
        return max((each.size for each in list_arrays(load, set(seen)) if any(each.strides)), default=0)

    assert measure() <= len(load.values)
    load.fields.take_far(np.arange(mesh.nodes // 8))
    assert measure() <= mesh.nodes // 4
