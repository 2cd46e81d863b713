"""Many small bodies: the factors are those of the whole tangent operator, and GMRES ends at once with them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from pbem.bem import body_factors
from pbem.bem.body_factors import choose_body_factors, count_body_factors
from pbem.case.build import parse_model
from pbem.contact.constraints import ConstraintMap
from pbem.contact.laws import OPEN, SLIP, STICK, ModeState
from pbem.mesh.generate import generate_mesh
from pbem.mesh.mesh import Mesh
from pbem.parallel import world
from pbem.results.reader import Results
from pbem.solve.petsc.session import petsc_options
from pbem.solve.preconditioner import subdomains as groups
from pbem.solve.preconditioner.bodies import BodiesPreconditioner, BodyFactors
from pbem.solve.problem.problem import Problem
from pbem.solve.system import hierarchical as system
from pbem.solve.system.assembly import assemble_problem
from pbem.solve.tangent.krylov import KrylovTangent
from scripts.bench_connected import write_layers, write_wall
from tests.identities.solving import assemble_tangent, linearise_pairs
from tests.unit.case_sample import BLOCKS
from tests.unit.far_sample import TEXTS, read_sample
from tests.unit.test_forcing import expect_same
from tests.unit.test_gone_on_with import run

Real = NDArray[np.float64]
WALL = write_wall(0.25)  # 5 x 5 bricks
LAYERS = write_layers(0.2).replace("elements = 24", "elements = 18")  # 8 layers
MIXED = ("cracks", "infinite", "panel")
Compute = Callable[[str], tuple[Results, list[int]]]
pytestmark = pytest.mark.usefixtures("without_errors")


@pytest.fixture(scope="module")
def compute(tmp_path_factory: pytest.TempPathFactory) -> Compute:
    """`compute(text)` gives the results of a case that nothing disturbs, and its counts; each is computed once."""
    return cache(lambda text: run(text, tmp_path_factory.mktemp("usual")))


@pytest.fixture
def small_groups(monkeypatch: pytest.MonkeyPatch) -> None:
    """Groups of parts of a body, which are inverted in a fraction of the time that several bodies take."""
    monkeypatch.setattr(groups, "BODY_ELEMENTS", 16)
    monkeypatch.setattr(groups, "BODY_SHARE", 1.5)


def read_mesh(text: str) -> Mesh:
    return generate_mesh(parse_model(text)[1])


@pytest.fixture
def by_bodies(monkeypatch: pytest.MonkeyPatch) -> None:
    """However few or large the bodies are."""
    monkeypatch.setattr(system, "choose_body_factors", count_body_factors)


def assemble(name: str, operator: str) -> Problem:
    model = read_sample(name, operator)
    return assemble_problem(model, generate_mesh(model), world)


def assemble_text(text: str) -> Problem:
    model = parse_model(text)[1]
    model = replace(model, solver=replace(model.solver, operator="hierarchical"))
    return assemble_problem(model, generate_mesh(model), world)


def constrain(problem: Problem, modes: ModeState | None) -> ConstraintMap:
    return problem.constrain(linearise_pairs(problem, modes), problem.evaluate_load(0, 1.0))


def draw_modes(problem: Problem) -> ModeState:
    random, count = np.random.default_rng(1), problem.mesh.pairs.count
    return ModeState(random.choice([STICK, SLIP, OPEN], count).astype(np.int8), random.choice([-1.0, 1.0], count))


@pytest.mark.parametrize(("name", "mixed"), [*((name, False) for name in TEXTS), *((name, True) for name in MIXED)])
def test_it_is_the_inverse(name: str, mixed: bool, by_bodies: None) -> None:
    problem = assemble(name, "hierarchical")
    modes = draw_modes(problem) if mixed else None
    tangent = problem.make_tangent()
    assert isinstance(tangent, KrylovTangent) and isinstance(tangent.preconditioner, BodiesPreconditioner)
    assert tangent.preconditioner.update(constrain(problem, modes)) == 1 and tangent.preconditioner.whole
    exact = assemble_tangent(assemble(name, "dense"), modes)
    unknowns = np.random.default_rng(3).normal(size=problem.unknowns)
    # Lengths in any unit: sizes that single precision would not hold.
    for size in (1.0, 1e-60):
        found = np.zeros(problem.unknowns)
        tangent.preconditioner.apply(size * (exact @ unknowns), found)
        np.testing.assert_allclose(found / size, unknowns, rtol=0, atol=1e-8 * np.abs(unknowns).max())
    assert tangent.preconditioner.update(constrain(problem, modes)) == 0
    tangent.destroy()


@pytest.mark.parametrize("text", [WALL, LAYERS], ids=["wall", "layers"])
def test_systems_take_one_or_two_iterations(
    text: str, compute: Compute, small_groups: None, tmp_path: Path
) -> None:
    found, counts = compute(text)
    assert len(counts) >= 5 and np.ptp(np.concatenate([each.mode[-1] for each in found.contact.values()])) == 2
    # A few pairs that changed are left to GMRES, by no more products than pairs have unknowns.
    assert np.median(counts) == 1 and max(counts) <= 8
    without, further = run(text, tmp_path, newton_bodies="0")
    assert sum(further) > (2 * sum(counts) if text == LAYERS else 0)
    expect_same(found, without)


def test_units_change_no_count(compute: Compute, tmp_path: Path) -> None:
    """The wall in metres and pascals: moduli and stresses times a million, weights by volume too."""
    pascal = WALL.replace("1000.0", "1e9").replace("density = 0.05", "density = 5e4")
    pascal = pascal.replace("ty = -1.0", "ty = -1e6").replace("tx = 0.3", "tx = 3e5")
    (found, counts), (other, further) = compute(WALL), run(pascal, tmp_path, newton_bodies="1")
    assert counts == further
    for name, contact in found.contact.items():
        np.testing.assert_array_equal(other.contact[name].mode, contact.mode)


def test_a_singular_operator_leaves_it_to_the_groups(
    compute: Compute, small_groups: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found, _ = compute(LAYERS)
    calls = []

    def refuse(self: BodyFactors, constraints: object) -> bool:
        calls.append(1)
        return False

    monkeypatch.setattr(BodyFactors, "factorise", refuse)
    by_groups, _ = run(LAYERS, tmp_path, newton_bodies="1")
    assert len(calls) == 1
    expect_same(found, by_groups)


def test_bad_factors_are_made_anew_before_they_are_given_up(small_groups: None) -> None:
    problem = assemble_text(LAYERS)
    tangent = problem.make_tangent()
    assert isinstance(tangent, KrylovTangent)
    preconditioner = tangent.preconditioner
    modes = ModeState(np.full(problem.mesh.pairs.count, STICK, dtype=np.int8), np.ones(problem.mesh.pairs.count))
    assert preconditioner.update(constrain(problem, modes)) == 1
    modes.mode[0] = OPEN
    assert preconditioner.update(constrain(problem, modes)) == 0  # a single pair
    preconditioner.give_up()
    assert preconditioner.update(constrain(problem, modes)) == 1 and preconditioner.whole
    preconditioner.give_up()
    assert preconditioner.update(constrain(problem, modes)) > 1 and not preconditioner.whole
    tangent.destroy()


def test_a_singular_operator_has_no_factors(small_groups: None, monkeypatch: pytest.MonkeyPatch) -> None:
    problem = assemble_text(LAYERS)
    tangent = problem.make_tangent()
    assert isinstance(tangent, KrylovTangent) and tangent.preconditioner.whole
    form = BodyFactors._form
    monkeypatch.setattr(BodyFactors, "_form", lambda *given: 0.0 * form(*given))
    assert tangent.preconditioner.update(constrain(problem, None)) == len(tangent.preconditioner.inverses)
    assert not tangent.preconditioner.whole
    tangent.destroy()


def test_options_that_ask_for_no_factors_leave_it_to_the_groups(small_groups: None) -> None:
    problem = assemble_text(LAYERS)
    tangent = problem.make_tangent()
    assert isinstance(tangent, KrylovTangent) and tangent.preconditioner.whole
    with petsc_options({"bodies_pc_type": "jacobi"}):
        tangent.preconditioner.update(constrain(problem, None))
    assert not tangent.preconditioner.whole
    tangent.destroy()


def test_what_one_rank_lacks_alone_is_not_passed_over(monkeypatch: pytest.MonkeyPatch) -> None:
    """The others would wait for it where all of them factorise."""
    problem = assemble_text(LAYERS)
    tangent = problem.make_tangent()
    assert isinstance(tangent, KrylovTangent) and tangent.preconditioner.whole

    def lack(self: BodyFactors, *_: object) -> None:
        raise MemoryError

    monkeypatch.setattr(BodyFactors, "_form", lack)
    with pytest.raises(MemoryError):
        tangent.preconditioner.update(constrain(problem, None))


def test_entries_and_operations_are_counted_as_dissection_gives_them() -> None:
    mesh = read_mesh(BLOCKS)
    count = count_body_factors(mesh)
    one, other = mesh.node_region[mesh.pairs.first], mesh.node_region[mesh.pairs.second]
    assert len(mesh.region_names) == 2 and (one != other).all()
    shared, factored, operations = 4.0 * mesh.pairs.count, 0.0, 0.0
    for region in range(2):
        own = 2.0 * (mesh.node_region == region).sum() - shared / 2
        factored += own * (own + 2 * shared)
        operations += 2 / 3 * ((own + shared) ** 3 - shared**3)
    assert count.factored == pytest.approx(factored + shared**2)
    assert count.operations == pytest.approx(operations + 2 / 3 * shared**3)


@pytest.mark.parametrize("text", [WALL, LAYERS], ids=["wall", "layers"])
def test_counted_factors_are_about_those_of_the_solver(text: str) -> None:
    problem = assemble_text(text)
    mesh = problem.mesh
    tangent = problem.make_tangent()
    assert isinstance(tangent, KrylovTangent) and isinstance(tangent.preconditioner, BodiesPreconditioner)
    tangent.preconditioner.update(constrain(problem, None))
    factors = tangent.preconditioner._factors
    assert factors is not None
    count, solver = count_body_factors(mesh), factors._solver.solver
    assert solver is not None
    factor = solver.getPC().getFactorMatrix()
    assert 0.6 < count.factored / factor.getMumpsInfog(29) < 1.6
    assert 0.5 < count.operations / factor.getMumpsRinfog(3) < 2.0
    assert sum(block.transposed.size for block in factors._blocks) == count.rows
    tangent.destroy()


def test_it_is_taken_where_it_stores_little(monkeypatch: pytest.MonkeyPatch) -> None:
    wall, large = read_mesh(WALL), read_mesh(BLOCKS.replace("elements = ", "elements = 10"))
    assert choose_body_factors(wall) is not None
    assert 2 * large.nodes > 4000 and choose_body_factors(large) is None
    assert choose_body_factors(read_mesh(BLOCKS)) is None  # one group
    for name in ("MOST_ENTRIES", "MOST_OPERATIONS"):
        with monkeypatch.context() as less:
            less.setattr(body_factors, name, 300.0)
            assert choose_body_factors(wall) is None


def test_the_log_tells_it() -> None:
    assert "factorises all bodies together" in " ".join(assemble_text(LAYERS).system.notes)
    with petsc_options({"newton_bodies": "0"}):
        assert "groups in the preconditioner" in " ".join(assemble_text(LAYERS).system.notes)
