"""An operator that has not changed: GMRES goes on with the directions that it has of it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import pbem
from pbem.contact.loads import Load
from pbem.contact.modes import Linearisation
from pbem.solve.preconditioner import group_inverses
from pbem.solve.preconditioner import subdomains as groups
from pbem.solve.problem.step import Iteration, SilentReporter
from pbem.solve.tangent.krylov import KrylovTangent
from tests.identities.solving import linearise_pairs
from tests.unit.test_nearby import draw_modes
from tests.unit.test_sweeps import assemble, write_network

pytestmark = pytest.mark.usefixtures("without_errors")

Real = NDArray[np.float64]


def write_layers(count: int, elements: int, shear: float, order: int = 1) -> str:
    """Layers of 10 x 0.3 with friction between them; the lowest is held, the highest pressed and then sheared."""
    lines = ["materials.rock = { young = 1000.0, poisson = 0.25 }"]
    for k in range(count + 1):
        lines.append(f"curves.s{k} = {{ points = [[0, {0.3 * k}], [10, {0.3 * k}]], elements = {elements}, "
                     'grading = "none" }')
    for k in range(count):
        low, high = 0.3 * k, 0.3 * (k + 1)
        lines += [f'curves.l{k} = {{ points = [[0, {high}], [0, {low}]], elements = 1, grading = "none" }}',
                  f'curves.r{k} = {{ points = [[10, {low}], [10, {high}]], elements = 1, grading = "none" }}',
                  f'regions.a{k} = {{ material = "rock", boundary = ["s{k}", "r{k}", "s{k + 1}", "l{k}"] }}']
    lines += [f'interfaces.s{k} = {{ law = "coulomb", friction = 0.5 }}' for k in range(1, count)]
    for load in ("ty = -1.0", f"tx = {shear}", f"tx = {1.01 * shear}"):
        lines += ["[[stages]]", "steps = 1", f"[stages.boundary.s{count}]", load]
    return "\n".join([*lines, "[boundary.s0]", "ux = 0.0", "uy = 0.0", "[analysis]", f"order = {order}", ""])


class Counting(SilentReporter):
    """Iterations of GMRES of every system."""

    def __init__(self) -> None:
        self.linear: list[int] = []

    def iterate(self, iteration: Iteration) -> None:
        self.linear.append(iteration.linear_iterations)


@pytest.fixture
def small_groups(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(groups, "ONE_GROUP", 0)
    monkeypatch.setattr(groups, "BODY_ELEMENTS", 16)
    monkeypatch.setattr(groups, "BODY_SHARE", 1.5)
    monkeypatch.setattr(group_inverses, "MOST_LEFT_OF_BODIES", 0)


def run(text: str, folder: Path, **petsc: str) -> tuple[pbem.Results, list[int]]:
    case, counting = folder / "case.toml", Counting()
    case.write_text(text, encoding="utf-8")
    name = folder / f"{'-'.join(petsc.values())}.h5"
    results = pbem.run(case, name, operator="hierarchical", reporter=counting, petsc=petsc)
    return results, counting.linear


def test_an_operator_that_stays_is_solved_by_what_is_known(small_groups: None, tmp_path: Path) -> None:
    """Three loads of bonded layers: the second differs in kind, the third is nearly the second."""
    text = write_layers(5, 10, 0.35).replace('"coulomb", friction = 0.5', '"bonded"')
    found, counts = run(text, tmp_path)
    assert len(counts) == 3
    assert counts[2] <= 3 < counts[0]
    # The last load alone, from nothing.
    first, last = text.index("[[stages]]"), text.rindex("[[stages]]")
    both = text[last:].replace("tx =", "ty = -1.0\ntx =")
    exact, _ = run(text[:first] + both, tmp_path, newton_bodies="0")
    for name, contact in exact.contact.items():
        for field in ("traction_n", "traction_s"):
            expected, value = getattr(contact, field)[-1], getattr(found.contact[name], field)[-1]
            np.testing.assert_allclose(value, expected, rtol=0, atol=1e-6 * np.abs(expected).max())


def test_another_operator_is_known_by_its_columns_and_by_the_anchors_that_act() -> None:
    """Not by what is given: loads, and the laws' offsets. To the last bit, as the directions are one operator's."""
    problem = assemble(write_network(2, 4))
    tangent, count = problem.make_tangent(), problem.laws.count
    assert isinstance(tangent, KrylovTangent)
    law = linearise_pairs(problem, draw_modes(count), -1.0).store()
    half, whole = problem.evaluate_load(0, 0.5), problem.evaluate_load(0, 1.0)
    released = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 2)))[0]

    def take(law: Linearisation, load: Load, released: Real | None = None) -> bool:
        return tangent.product.take_map(replace(problem.constrain(law, load), released=released))

    take(law, half)
    assert not take(law, half)
    assert not take(replace(law, offset=law.offset + 1.0), whole)
    slope = law.tangent.copy()
    largest = np.unravel_index(np.abs(slope).argmax(), slope.shape)
    slope[largest] = np.nextafter(slope[largest], np.inf)
    assert take(replace(law, tangent=slope), whole)
    assert not take(replace(law, tangent=slope), half)
    for one, another in ((released, None), (released[::-1], released), (released[:, :1], released[:, :1].copy())):
        take(law, whole, one)
        assert not take(law, whole, None if one is None else one.copy())
        assert take(law, whole, another) != np.array_equal(one, another)
    tangent.destroy()
