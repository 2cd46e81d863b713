"""Directions that are kept from system to system: the same results by fewer iterations of GMRES."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

import pbem
from pbem.solve.preconditioner import schwarz
from pbem.solve.preconditioner import subdomains as groups
from pbem.solve.problem.step import Iteration, SilentReporter
from pbem.solve.tangent.recycled import RecycledSpace
from tests.unit.test_forcing import Dense, expect_same


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
    monkeypatch.setattr(schwarz, "MOST_LEFT_OF_BODIES", 0)


def run(text: str, folder: Path, **petsc: str) -> tuple[pbem.Results, list[int]]:
    case, counting = folder / "case.toml", Counting()
    case.write_text(text, encoding="utf-8")
    name = folder / f"{'-'.join(petsc.values())}.h5"
    results = pbem.run(case, name, operator="hierarchical", reporter=counting, petsc=petsc)
    return results, counting.linear


def test_layers_that_slide_take_fewer_iterations(small_groups: None, tmp_path: Path) -> None:
    text = write_layers(5, 10, 0.35)
    (exact, plain), (found, few) = (run(text, tmp_path, newton_recycled=most) for most in ("0", "40"))
    expect_same(found, exact)
    assert (found.contact["s3"].mode[-1] != found.contact["s3"].mode[0]).any()
    # The first system has nothing before it.
    assert few[0] == plain[0] <= 40
    assert len(few) == len(plain)
    assert sum(few[1:]) <= 0.9 * sum(plain[1:])


def test_an_operator_that_stays_is_solved_by_what_is_known(small_groups: None, tmp_path: Path) -> None:
    """Three loads of bonded layers: the second differs in kind, the third is nearly the second."""
    text = write_layers(5, 10, 0.35).replace('"coulomb", friction = 0.5', '"bonded"')
    (exact, plain), (found, few) = (run(text, tmp_path, newton_recycled=most) for most in ("0", "40"))
    expect_same(found, exact)
    for counts in (plain, few):
        assert len(counts) == 3
        assert counts[2] <= 3 < counts[0]


def test_what_is_known_of_an_operator_is_taken_from_its_products() -> None:
    size, kept = 40, 20
    system, space = Dense(size, 6), RecycledSpace(MPI.COMM_SELF)
    rng = np.random.default_rng(3)
    directions = rng.normal(size=(size, kept))
    directions[:6] = 0.0
    changed = np.zeros(size, dtype=bool)
    changed[11] = True
    products = np.stack([system.multiply(each) for each in directions.T], axis=1)
    space.keep(directions, products)
    turned = np.stack([system.turn(each) for each in products.T], axis=1)
    space.fit(np.zeros(size, dtype=bool), system.judged[:, None] * turned)
    move = directions @ rng.normal(size=kept)
    residual = system.multiply(move)
    known, left = space.split(residual, system)
    np.testing.assert_allclose(known, move, rtol=0, atol=1e-4 * np.abs(move).max())
    # Equations that determine unknowns of their own keep their residual.
    expected = np.where(system.judged > 0, 0.0, system.turn(residual))
    np.testing.assert_allclose(system.turn(left), expected, rtol=0, atol=1e-4 * np.abs(residual).max())
    # Unknowns whose columns changed are left alone.
    space.fit(changed, system.judged[:, None] * turned)
    assert not space.split(residual, system)[0][changed].any()


def test_few_directions_are_not_kept() -> None:
    space = RecycledSpace(MPI.COMM_SELF)
    space.keep(np.ones((30, 8)), np.ones((30, 8)))
    assert space.count == 0
    space.keep(np.ones((30, 25)), np.ones((30, 25)))
    space.keep(np.full((30, 30), 2.0), np.ones((30, 30)))
    assert space.count == 40
    assert space._directions[0].tolist() == [2.0] * 30 + [1.0] * 10


def test_a_rank_without_rows_keeps_as_many_directions_as_the_others() -> None:
    """Of a small model one rank may have all rows; directions come twice, as from one system to the next."""
    space = RecycledSpace(MPI.COMM_SELF, 40)
    for count in (15, 12):
        space.keep(np.zeros((0, count)), np.zeros((0, count)))
    assert space.count == 27
