"""The energy balance against closed-form energies, and how exactly it closes."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from numpy.typing import NDArray

from pbem.contact.laws import OPEN, SLIP, STICK, PairLaws, collect_laws
from pbem.geometry.curve import Curve
from pbem.geometry.loop import Loop, Side
from pbem.mesh.generate import generate_mesh
from pbem.model.in_situ import LinearStress
from pbem.model.material import Material
from pbem.model.model import (
    Analysis,
    Condition,
    Interface,
    Law,
    Model,
    Quantity,
    Region,
    SolverOptions,
    Stage,
)
from pbem.results import dissipation
from pbem.results.describe import describe_results
from pbem.results.dissipation import PairRecord, PairWork, measure_work
from pbem.results.energy import Energy, EnergyBalance
from pbem.results.face_weights import weigh_faces
from pbem.results.reader import open_results
from pbem.results.runaway import Runaway
from pbem.results.writer import ResultWriter
from pbem.solve.problem.step import Step
from tests.verification.planes import FREE, ROCK, make_arc, make_circle, make_plane, make_straight, solve

Real = NDArray[np.float64]
SLATE = Material("slate", 25e3, 0.25)
HELD: tuple[Quantity, Quantity] = ("displacement", "displacement")
ROLLING_X: tuple[Quantity, Quantity] = ("displacement", "traction")
UNHELD: tuple[Quantity, Quantity] = ("traction", "traction")


def add_energies(model: Model) -> list[Energy]:
    mesh, steps = solve(model)
    balance = EnergyBalance(model, mesh)
    return [balance.add(step) for step in steps]


def measure_gap(energies: list[Energy]) -> float:
    """Largest lack of balance, relative to the largest work."""
    gaps = [abs(each.external - each.elastic - each.dissipated) for each in energies]
    return max(gaps) / max(abs(each.external) for each in energies)


def expect_energy(found: Energy, external: float, elastic: float, dissipated: float, tolerance: float) -> None:
    np.testing.assert_allclose(
        [found.external, found.elastic, found.dissipated], [external, elastic, dissipated], rtol=tolerance, atol=1e-14
    )


def stack_blocks(
    stages: tuple[Stage, ...],
    law: Law,
    elements: tuple[int, int] = (4, 4),
    power: float | None = None,
    order: int = 2,
    materials: tuple[Material, Material] = (Material("soft", 3e3, 0.2), Material("hard", 2e3, 0.3)),
    top: tuple[Quantity, Quantity] = HELD,
    origin: complex = 0j,
) -> Model:
    """Two blocks 2 x 1 that meet at y = 1 from the origin on, held at the bottom; the top follows the stages.

    elements: of every outer side, and of the joint.
    """
    corners = {
        "bottom": (0j, 2 + 0j), "right_lower": (2 + 0j, 2 + 1j), "left_lower": (1j, 0j), "joint": (1j, 2 + 1j),
        "right_upper": (2 + 1j, 2 + 2j), "top": (2 + 2j, 2j), "left_upper": (2j, 1j),
    }  # fmt: skip
    curves = {
        name: Curve(name, (make_straight(origin + start, origin + end, elements[name == "joint"], power),))
        for name, (start, end) in corners.items()
    }
    lower = [Side("bottom", True), Side("right_lower", True), Side("joint", False), Side("left_lower", True)]
    upper = [Side(name, True) for name in ("joint", "right_upper", "top", "left_upper")]
    conditions = {name: Condition(name) for name in corners if name != "joint"}
    conditions |= {"bottom": Condition("bottom", known=HELD), "top": Condition("top", known=top)}
    return Model(
        title="blocks", units_length="m", units_stress="MPa", source="",
        regions=(
            Region("lower", materials[0], (Loop(tuple(lower), True),)),
            Region("upper", materials[1], (Loop(tuple(upper), True),)),
        ),
        curves=curves, interfaces={"joint": Interface("joint", "lower", "upper", law)}, conditions=conditions,
        crack_tips={}, stages=stages, analysis=Analysis("SST", order), solver=SolverOptions(), output_every=1, size=2.0,
    )  # fmt: skip


def shear_and_back(steps: int = 5) -> tuple[Stage, ...]:
    return (
        Stage("press", 2, {"top": (0.0, -0.001)}, {}),
        Stage("shear", steps, {"top": (0.005, -0.001)}, {}),
        Stage("back", steps, {"top": (-0.003, -0.0005)}, {}),
    )


# Without lateral strain: blocks without Poisson's ratio.
COLUMN = (Material("one", 3e3, 0.0), Material("two", 2e3, 0.0))


def test_a_column_stores_what_presses_it() -> None:
    model = stack_blocks((Stage("press", 3, {"top": (0.0, -0.001)}, {}),), Law("bonded"), materials=COLUMN)
    stored = 0.5 * 2 * 0.001**2 / (1 / 3e3 + 1 / 2e3)
    expect_energy(add_energies(model)[-1], stored, stored, 0.0, 1e-10)


def test_elastic_joints_store_their_part() -> None:
    law = Law("bonded", normal_stiffness=1e3, tangential_stiffness=1e3)
    model = stack_blocks((Stage("press", 3, {"top": (0.0, -0.001)}, {}),), law, materials=COLUMN)
    stored = 0.5 * 2 * 0.001**2 / (1 / 3e3 + 1 / 2e3 + 1 / 1e3)
    expect_energy(add_energies(model)[-1], stored, stored, 0.0, 1e-10)


def test_springs_store_their_part() -> None:
    stages = (Stage("press", 2, {"top": (0.0, -1.0)}, {}),)
    model = stack_blocks(stages, Law("bonded"), materials=COLUMN, top=UNHELD)
    bed = Condition("bottom", known=ROLLING_X, stiffness=(0.0, 500.0))
    model = replace(model, conditions={**model.conditions, "bottom": bed})
    stored = 0.5 * 2 * (1 / 500 + 1 / 3e3 + 1 / 2e3)
    expect_energy(add_energies(model)[-1], stored, stored, 0.0, 1e-10)


def test_weight_does_work() -> None:
    # Columns between smooth sides, both of the same material: sinking by b/M (H y - y^2/2).
    heavy = Material("heavy", 1e3, 0.25, density=2.0)
    stages = (Stage("weight", 2, {}, {}, gravity=(0.0, -3.0)), Stage("half", 1, {}, {}, gravity=(0.0, -1.5)))
    model = stack_blocks(stages, Law("bonded"), materials=(heavy, heavy), top=UNHELD, origin=3 - 1j)
    sides = {name: Condition(name, known=ROLLING_X) for name in model.conditions if name not in ("top", "bottom")}
    model = replace(model, conditions={**model.conditions, **sides})
    modulus = heavy.shear_modulus * (heavy.kappa + 1) / (heavy.kappa - 1)
    stored = 0.5 * 2 * (2.0 * 3.0) ** 2 / modulus * 2**3 / 3
    energies = add_energies(model)
    expect_energy(energies[1], stored, stored, 0.0, 1e-9)
    expect_energy(energies[2], stored / 4, stored / 4, 0.0, 1e-9)


def test_release_of_in_situ_stress_in_a_finite_body() -> None:
    # s0 = -p along y in a column whose top is free: it stretches by p/E and the energy of the stress is gone.
    soft = COLUMN[0]
    model = stack_blocks((Stage("wait", 1, {}, {}),), Law("bonded"), materials=(soft, soft), top=UNHELD)
    model = replace(model, initial_stress={"one": LinearStress((0.0, -6.0, 0.0))})
    lost = -0.5 * 6.0**2 / 3e3 * 4
    expect_energy(add_energies(model)[-1], lost, lost, 0.0, 1e-9)


@pytest.mark.parametrize("law", [Law("bonded"), Law("bonded", normal_stiffness=1e3, tangential_stiffness=1e3)])
@pytest.mark.parametrize(("stressed", "modulus"), [("one", 3e3), ("two", 2e3)])
def test_in_situ_stress_of_one_block_is_relieved_at_the_joint(law: Law, stressed: str, modulus: float) -> None:
    # The stressed block stretches by p/E, the other one has nothing to bear: stress out of balance at the joint works.
    model = stack_blocks((Stage("wait", 1, {}, {}),), law, materials=COLUMN, top=UNHELD)
    model = replace(model, initial_stress={stressed: LinearStress((0.0, -6.0, 0.0))})
    lost = -0.5 * 6.0**2 / modulus * 2
    expect_energy(add_energies(model)[-1], lost, lost, 0.0, 1e-9)


def test_energies_do_not_depend_on_which_side_is_first() -> None:
    # The upper block spreads under stress across, that the lower one does not have, and slides on it.
    def relieve(first: str, second: str) -> Energy:
        model = stack_blocks((Stage("press", 1, {"top": (0.0, -1e-3)}, {}),), Law("coulomb", 0.1))
        regions = {each.name: each for each in model.regions}
        model = replace(
            model, regions=(regions[first], regions[second]), initial_stress={"hard": LinearStress((-6.0, -1.0, 0.0))},
            interfaces={"joint": replace(model.interfaces["joint"], first=first, second=second)},
        )  # fmt: skip
        return add_energies(model)[-1]

    energy = relieve("lower", "upper")
    assert energy.dissipated > 1e-3 * abs(energy.elastic)
    expect_energy(relieve("upper", "lower"), energy.external, energy.elastic, energy.dissipated, 1e-6)
    assert abs(energy.external - energy.elastic - energy.dissipated) < 1e-6 * abs(energy.elastic)


def test_excess_of_a_hole_far_stress() -> None:
    # A dilute array of holes has the compliance (1 + 3 c)/E': the excess of one is 3/2 of its area times S^2/E'.
    energy = add_energies(make_plane((2.0, 0.0, 0.0), hole=make_circle(1.5, 48)))[-1]
    excess = 1.5 * math.pi * 1.5**2 * 2.0**2 / ROCK.plane_modulus
    expect_energy(energy, excess, excess, 0.0, 1e-6)


def test_excavation_of_a_hole() -> None:
    # The excess of the hole, and the energy 1/2 of its area times S^2/E' that its ground had.
    at_rest = {"rock": LinearStress((2.0, 0.0, 0.0))}
    model = replace(make_plane((0.0, 0.0, 0.0), hole=make_circle(1.5, 48)), initial_stress=at_rest)
    change = 2.0 * math.pi * 1.5**2 * 2.0**2 / ROCK.plane_modulus
    expect_energy(add_energies(model)[-1], change, change, 0.0, 1e-6)


def test_a_hole_filled_with_next_to_nothing_is_excavated() -> None:
    filling = Material("foam", 1e-9 * ROCK.young, 0.2)
    model = make_plane((0.0, 0.0, 0.0), hole=make_circle(1.5, 48), inclusion=filling)
    change = 2.0 * math.pi * 1.5**2 * 2.0**2 / ROCK.plane_modulus
    energy = add_energies(replace(model, initial_stress={"rock": LinearStress((2.0, 0.0, 0.0))}))[-1]
    expect_energy(energy, change, change, 0.0, 1e-6)


def test_a_filled_hole_is_no_excess() -> None:
    hole = make_circle(1.5, 16)
    same = replace(ROCK, name="same")
    energy = add_energies(make_plane((2.0, 1.0, 0.3), hole=hole, inclusion=same))[-1]
    scale = math.pi * 1.5**2 * 2.0**2 / ROCK.plane_modulus
    assert abs(energy.external) < 1e-5 * scale
    assert abs(energy.elastic) < 1e-5 * scale


@pytest.mark.parametrize("steps", [1, 3])
def test_excess_of_a_crack_under_far_tension_or_fluid_pressure(steps: int) -> None:
    # Griffith: pi a^2 s^2 / E', whether the stress comes from far away or from a fluid inside.
    crack = {"crack": [make_straight(-1.3, 1.3, 8)]}
    far = (Stage("pull", steps, {}, {}, remote=(0.0, 2.0, 0.0)),)
    fluid = (Stage("press", steps, {}, {"crack": 2.0}),)
    excess = math.pi * 1.3**2 * 2.0**2 / ROCK.plane_modulus
    for stages in (far, fluid):
        energies = add_energies(make_plane((0.0, 0.0, 0.0), crack, FREE, stages=stages))
        expect_energy(energies[-1], excess, excess, 0.0, 1e-4)


def make_closed_crack(stages: tuple[Stage, ...]) -> tuple[Model, float, float, float]:
    """A crack at 20 degrees to a compression along y; shear and friction on it per unit of compression, and the
    integral of its slip per unit of shear."""
    psi, friction = math.radians(20.0), math.tan(math.radians(30.0))
    along = np.exp(1j * (math.pi / 2 - psi))
    model = make_plane(
        (0.0, 0.0, 0.0), {"crack": [make_straight(-along, along, 8)]}, Law("coulomb", friction), material=SLATE,
        stages=stages,
    )  # fmt: skip
    slip = math.pi / 2 * 4 / SLATE.plane_modulus
    return model, math.sin(psi) * math.cos(psi), friction * math.sin(psi) ** 2, slip


@pytest.mark.parametrize("steps", [1, 4])
def test_friction_of_a_closed_crack(steps: int) -> None:
    model, shear, friction, per_shear = make_closed_crack((Stage("press", steps, {}, {}, remote=(0.0, -100.0, 0.0)),))
    slip = per_shear * 100 * (shear - friction)
    external, dissipated = 0.5 * 100 * shear * slip, 0.5 * 100 * friction * slip
    expect_energy(add_energies(model)[-1], external, external - dissipated, dissipated, 1e-4)


def test_a_closed_crack_that_is_unloaded_slips_back() -> None:
    steps = 60
    model, shear, friction, per_shear = make_closed_crack(
        (
            Stage("press", steps, {}, {}, remote=(0.0, -100.0, 0.0)),
            Stage("release", steps, {}, {}, remote=(0.0, 0.0, 0.0)),
        )
    )
    slip = per_shear * 100 * (shear - friction)
    # It sticks until the shear locked in exceeds the friction of what compression is left.
    turn = (shear - friction) / (shear + friction)
    dissipated = 0.5 * 100 * friction * slip * (1 + turn)
    energies = add_energies(model)
    np.testing.assert_allclose(energies[-1].dissipated, dissipated, rtol=1e-3)
    assert abs(energies[-1].elastic) < 1e-12 * dissipated
    assert (np.diff([each.dissipated for each in energies]) >= 0).all()
    assert measure_gap(energies) < 1e-12


def test_one_step_from_rest_balances_exactly() -> None:
    model = stack_blocks((Stage("all", 1, {"top": (0.002, -0.001)}, {}),), Law("coulomb", 0.4, 0.1))
    energies = add_energies(model)
    assert energies[-1].dissipated > 0.01 * energies[-1].external
    assert measure_gap(energies) < 1e-12


# elements of the outer sides and of the joint, order, lack of balance over a history with slip, reversal and parting
BALANCES = [((6, 10), 2, 2e-4), ((12, 20), 2, 2e-5), ((12, 20), 3, 2e-7)]


@pytest.mark.parametrize("elements, order, gap", BALANCES)
def test_the_balance_converges_with_the_mesh(elements: tuple[int, int], order: int, gap: float) -> None:
    energies = add_energies(stack_blocks(shear_and_back(), Law("coulomb", 1.0), elements, 3.0, order))
    assert energies[-1].dissipated > 0.1 * energies[-1].external
    assert (np.diff([each.dissipated for each in energies]) >= 0).all()
    assert measure_gap(energies) < gap


def test_more_steps_change_little() -> None:
    few, many = (
        add_energies(stack_blocks(shear_and_back(steps), Law("coulomb", 1.0), (6, 10), 3.0))[-1] for steps in (5, 40)
    )
    np.testing.assert_allclose(few.dissipated, many.dissipated, rtol=0.02)


def test_a_law_is_asked_for_its_bound_some_pairs_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    model = stack_blocks(shear_and_back(2), Law("coulomb", 1.0), (4, 6), 3.0)
    together = add_energies(model)
    monkeypatch.setattr(dissipation, "INTEGRATED", 3)
    assert together[-1].dissipated > 0.1 * together[-1].external
    assert add_energies(model) == together


def test_weights_of_tip_elements_integrate_the_root() -> None:
    for leg in (make_straight(0, 2, 2), make_arc(2 + 0j, 1.3, 2)):
        mesh = generate_mesh(make_plane((0.0, 0.0, 0.0), {"crack": [leg]}))
        per_element = mesh.order + 1
        along, length = mesh.pairs.arc_length[:per_element], leg.length / 2
        weight = weigh_faces(mesh)
        np.testing.assert_allclose(weight[:per_element] @ np.sqrt(along), 2 / 3 * length**1.5, rtol=2e-3)
        assert (weight > 0).all()
        np.testing.assert_allclose(weight[mesh.nodes :], weight[: mesh.nodes][::-1].reshape(2, -1)[::-1].ravel())


def make_record(mode: np.int8, p_n: float, p_s: float, g_n: float, slip: float, broken: bool = False) -> PairRecord:
    p, s, g, h, zero = (np.array([float(value)]) for value in (p_n, p_s, g_n, slip, 0))
    return PairRecord(np.array([mode]), p, s, g, h, g, h, zero, {"slip_path": zero, "broken": np.array([broken])},
                      zero)


def measure_one(old: PairRecord, new: PairRecord, law: Law) -> PairWork:
    model = stack_blocks((Stage("none", 1, {}, {}),), law, (1, 1), order=0)
    laws: PairLaws = collect_laws(model, generate_mesh(model))
    return measure_work(laws, np.array([2.0]), old, new)


# before, after, law, dissipated per unit length
PAIRS: dict[str, tuple[PairRecord, PairRecord, Law, float]] = {
    "goes on slipping": (
        make_record(SLIP, -10, 5, 0, 1), make_record(SLIP, -12, 6, 0, 3), Law("coulomb", 0.5), 11.0),
    "begins to slip": (
        make_record(STICK, -10, 1, 0, 1), make_record(SLIP, -12, 6, 0, 3), Law("coulomb", 0.5), 11.0),
    "turns back": (
        make_record(SLIP, -10, 5, 0, 1), make_record(SLIP, -10, -5, 0, -1), Law("coulomb", 0.5), 10.0),
    "sticks": (make_record(SLIP, -10, 5, 0, 1), make_record(STICK, -10, 3, 0, 1), Law("coulomb", 0.5), 0.0),
    "parts": (make_record(STICK, -10, 0, 0, 0), make_record(OPEN, 0, 0, 1, 0), Law("coulomb", 0.5), 0.0),
    "closes": (make_record(OPEN, 0, 0, 1, 0), make_record(STICK, -10, 0, 0, 0), Law("coulomb", 0.5), 0.0),
    "closes and slips": (make_record(OPEN, 0, 0, 1, 0), make_record(SLIP, -10, 5, 0, 2), Law("coulomb", 0.5), 5.0),
    "closes and slips with cohesion": (
        make_record(OPEN, 0, 0, 1, 0), make_record(SLIP, -10, 8, 0, 2), Law("coulomb", 0.5, 3.0), 8.0),
    "a bond is torn": (
        make_record(STICK, 4, 0, 0, 0), make_record(OPEN, 0, 0, 3, 0, True),
        Law("coulomb", 0.5, 9.0, 5.0, cohesion_lost=True), 6.0),
    "a bond is sheared off": (
        make_record(STICK, -10, 8, 0, 0), make_record(SLIP, -10, 5, 0, 2, True),
        Law("coulomb", 0.5, 9.0, 5.0, cohesion_lost=True), 13.0),
    "cohesion": (
        make_record(STICK, 0, 0, 0, 0), make_record(SLIP, 0, -3, 0, -2), Law("coulomb", 0.5, 3.0), 6.0),
}  # fmt: skip


@pytest.mark.parametrize("case", PAIRS.values(), ids=[name.replace(" ", "_") for name in PAIRS])
def test_dissipation_of_one_pair(case: tuple[PairRecord, PairRecord, Law, float]) -> None:
    old, new, law, dissipated = case
    found = measure_one(old, new, law)
    np.testing.assert_allclose(found.dissipated, 2 * dissipated, atol=1e-14)
    assert found.stored == 0.0


WEAKENING = Law("coulomb", 0.6, friction_dynamic=0.3, slip_distance=2.0)
BOND = Law("coulomb", 0.5, 9.0, 5.0, cohesion_lost=True)
# before, after, law, what the laws take and what is left over, per unit length
SURPLUSES: dict[str, tuple[PairRecord, PairRecord, Law, float, float]] = {
    # Bound 6 falls to 3 over the slip of 2: half of 6 + 3 times 2, then 3 times 8; the trapezoid is 4.5 times 10.
    "weakens": (make_record(SLIP, -10, 6, 0, 0), make_record(SLIP, -10, 3, 0, 10), WEAKENING, 33.0, 12.0),
    "weakens backwards": (make_record(SLIP, -10, -6, 0, 0), make_record(SLIP, -10, -3, 0, -10), WEAKENING, 33.0, 12.0),
    # The same while the pressure grows in proportion to the slip, 10 + s: (0.6 - 0.15 s)(10 + s), then 0.3 (10 + s).
    "weakens while pressed": (
        make_record(SLIP, -10, 6, 0, 0), make_record(SLIP, -20, 6, 0, 10), WEAKENING, 9.8 + 38.4, 60 - 48.2),
    "within the slip distance": (
        make_record(SLIP, -10, 6, 0, 0), make_record(SLIP, -10, 4.5, 0, 1), WEAKENING, 5.25, 0.0),
    "a bond is torn": (make_record(STICK, 4, 0, 0, 0), make_record(OPEN, 0, 0, 3, 0, True), BOND, 0.0, 6.0),
    "a bond is sheared off": (make_record(STICK, -10, 8, 0, 0), make_record(SLIP, -10, 5, 0, 2, True), BOND, 10.0, 3.0),
}  # fmt: skip


@pytest.mark.parametrize("case", SURPLUSES.values(), ids=[name.replace(" ", "_") for name in SURPLUSES])
def test_what_a_law_takes_of_a_pair_and_what_is_left(case: tuple[PairRecord, PairRecord, Law, float, float]) -> None:
    old, new, law, taken, left = case
    found = measure_one(old, new, law)
    np.testing.assert_allclose(found.friction, 2 * taken, rtol=1e-12)
    np.testing.assert_allclose(found.surplus, 2 * left, rtol=1e-12, atol=1e-12)


def test_a_law_of_ones_own_is_integrated(tmp_path: Path) -> None:
    """Strength that falls exponentially: the integral of -p_n (0.2 + 0.4 exp(-s))."""
    file = tmp_path / "law.py"
    file.write_text(
        "import numpy as np\nfrom pbem.contact.strength import Strength\n"
        "def strength(p_n, slip):\n    f, d = 0.2 + 0.4*np.exp(-slip), -0.4*np.exp(-slip)\n"
        "    return Strength(-f*p_n, -f, -d*p_n)\n"
    )
    end = 10 * (0.2 + 0.4 * math.exp(-3))
    old, new = make_record(SLIP, -10, 6, 0, 0), make_record(SLIP, -10, end, 0, 3)
    found = measure_one(old, new, Law("custom", file=str(file)))
    np.testing.assert_allclose(found.dissipated, 2 * 10 * (0.2 * 3 + 0.4 * (1 - math.exp(-3))), rtol=1e-9)


def add_runaways(model: Model) -> tuple[list[Energy], list[Runaway | None], list[Step]]:
    mesh, steps = solve(model)
    balance = EnergyBalance(model, mesh)
    energies, runaways = [], []
    for step in steps:
        energies.append(balance.add(step))
        runaways.append(balance.runaway)
    return energies, runaways, steps


def make_fault(slip_distance: float, steps: int) -> Model:
    """A crack of half-length 1 whose friction falls from 0.6 to 0.3, pressed by 1 and sheared by 0.55, then to 0.65."""
    stages = (
        Stage("press", 1, {}, {}, remote=(0.0, -1.0, 0.55)), Stage("shear", steps, {}, {}, remote=(0.0, -1.0, 0.65)),
    )  # fmt: skip
    law = Law("coulomb", 0.6, friction_dynamic=0.3, slip_distance=slip_distance)
    return make_plane((0.0, 0.0, 0.0), {"fault": [make_straight(-1.0, 1.0, 16)]}, law, stages=stages)


def test_a_fault_that_runs_away_releases_what_its_law_does_not_take() -> None:
    """At a shear of 0.6 it slips at once: half of 0.6 + 0.3 on the slip, less 0.3 on it and the fracture energy."""
    distance, steps = 1e-5, 31
    energies, runaways, found = add_runaways(make_fault(distance, steps))
    (at,) = [number for number, runaway in enumerate(runaways) if runaway]
    reached = 0.55 + 0.1 * found[at].factor
    assert 0.6 <= reached < 0.6 + 0.2 / steps
    area = math.pi / 2 * 4 / ROCK.plane_modulus * 0.3  # integral of the slip
    released = 0.5 * 0.3 * area - 0.5 * 0.3 * distance * 2
    runaway = runaways[at]
    assert runaway is not None and runaway.names == ("fault",)
    np.testing.assert_allclose(runaway.released, released, rtol=0.03)
    # Of work and friction, the first 0.6 and the second 0.3 on the slip.
    np.testing.assert_allclose(runaway.share, released / (0.6 * area), rtol=0.03)
    last = energies[-1]
    assert last.released == runaway.released
    assert abs(last.external - last.elastic - last.dissipated - last.released) < 1e-5 * last.external
    slip = np.abs(found[-1].contact.slip)
    mesh = generate_mesh(make_fault(distance, steps))
    weight = weigh_faces(mesh)[mesh.pairs.first]
    within = np.minimum(slip, distance)
    by_law = weight @ (0.3 * slip + 0.3 * (within - within**2 / (2 * distance)))
    np.testing.assert_allclose(last.dissipated, by_law, rtol=1e-9)


@pytest.mark.parametrize("steps", [1, 2, 7])
def test_a_fault_that_weakens_slowly_releases_nothing(steps: int) -> None:
    energies, runaways, _ = add_runaways(make_fault(2e-2, steps))
    assert runaways == [None] * len(runaways)
    assert energies[-1].released == 0.0 and energies[-1].dissipated > 0.0
    assert abs(energies[-1].external - energies[-1].elastic - energies[-1].dissipated) < 1e-9 * energies[-1].external


@pytest.mark.parametrize("size", [1.0, 1e-6])
def test_a_column_that_is_torn_releases_all_that_it_stored(size: float) -> None:
    stages = (Stage("pull", 8, {"top": (0.0, 0.008 * size)}, {}),)
    law = Law("coulomb", 0.0, 10.0, tensile_strength=3.0, cohesion_lost=True)
    model = stack_blocks(stages, law, materials=COLUMN)
    if size != 1.0:
        resized = {
            name: Curve(name, tuple(replace(leg, start=size * leg.start, end=size * leg.end) for leg in curve.legs))
            for name, curve in model.curves.items()
        }
        model = replace(model, curves=resized, size=size * model.size)
    energies, runaways, found = add_runaways(model)
    (at,) = [number for number, runaway in enumerate(runaways) if runaway]
    stiffness = 2 / (1 / 3e3 + 1 / 2e3)  # force by displacement
    before, after = (0.008 * found[number].factor * size for number in (at - 1, at))
    force = stiffness * before
    assert force <= 3.0 * 2 * size < stiffness * after
    supplied = 0.5 * force * (after - before)
    expect = 0.5 * stiffness * before**2 + supplied
    runaway = runaways[at]
    assert runaway is not None
    np.testing.assert_allclose([runaway.released, runaway.share], [expect, 1.0], rtol=1e-8)
    expect_energy(replace(energies[-1], external=energies[-1].released), expect, 0.0, 0.0, 1e-8)


def test_released_energy_is_stored_shown_and_kept_on_resume(tmp_path: Path) -> None:
    model = make_fault(1e-4, 6)
    mesh, steps = solve(model)
    path = tmp_path / "fault.h5"
    with ResultWriter(path, model, mesh, 1, "") as writer:
        (told,) = [note for step in steps for note in writer.append(step)]
    results = open_results(path)
    at = int(np.argmax(results.energy.released > 0))
    assert told.startswith(f"Step {steps[at].number} ") and "'fault' moved unstably and released" in told
    assert f"in step {steps[at].number} faces moved unstably and released" in describe_results(results)
    broken = tmp_path / "broken.h5"
    first = ResultWriter(broken, model, mesh, 1, "")
    for step in steps[: at + 1]:
        first.append(step)
    first.fail("stopped", "")
    with ResultWriter.resume(broken, model, mesh, 1, "") as second:
        assert [note for step in steps[at + 1 :] for note in second.append(step)] == []
    np.testing.assert_allclose(open_results(broken).energy.released, results.energy.released, rtol=1e-12)


def test_files_without_released_energy_are_read_and_resumed(tmp_path: Path) -> None:
    model = stack_blocks(shear_and_back(2), Law("coulomb", 1.0), (2, 2))
    mesh, steps = solve(model)
    path = tmp_path / "old.h5"
    writer = ResultWriter(path, model, mesh, 1, "")
    for step in steps[:3]:
        writer.append(step)
    writer.fail("stopped", "")
    with h5py.File(path, "r+") as file:
        del file["energy/released"]
    assert open_results(path).energy.released.tolist() == [0.0, 0.0, 0.0]
    with ResultWriter.resume(path, model, mesh, 1, "") as again:
        for step in steps[3:]:
            again.append(step)
    assert open_results(path).energy.released.tolist() == [0.0] * len(steps)


def test_energies_in_the_file_count_all_steps_and_go_on_after_a_stop(tmp_path: Path) -> None:
    model = stack_blocks(shear_and_back(), Law("coulomb", 1.0))
    mesh, steps = solve(model)
    balance = EnergyBalance(model, mesh)
    expected = [balance.add(step) for step in steps]
    for every, stop in ((1, 4), (3, 9)):
        rare = replace(model, output_every=every)
        path = tmp_path / f"every{every}.h5"
        first = ResultWriter(path, rare, mesh, 1, "")
        for step in steps[:stop]:
            first.append(step)
        first.fail("stopped", "")
        with ResultWriter.resume(path, rare, mesh, 1, "") as second:
            assert second.last_step is not None and second.last_step.number == stop
            for step in steps[stop:]:
                second.append(step)
        results = open_results(path)
        for kind, values in vars(results.energy).items():
            wanted = [getattr(expected[number - 1], kind) for number in results.steps.number]
            np.testing.assert_allclose(values, wanted, rtol=1e-12, atol=1e-18)


def test_where_nothing_is_stored_and_supplied_nothing_is_set_free() -> None:
    """Stages without loads have rounding in their pairs: a part of no energy at all is not a number."""
    rounding = PairWork(0.0, 0.0, 0.0, 0.0, 0.0, np.array([1e-40, 3e-39]), 0.0)
    balance = SimpleNamespace(_measure_increments=lambda *_: 0.0)
    assert EnergyBalance._find_runaway(balance, None, None, None, rounding, 0.0) is None  # type: ignore[arg-type]
