"""Bonds that soften: shapes of softening, the law of open pairs and its tangent, energies, and the keys of a case."""

from __future__ import annotations

import numpy as np
import pytest

from pbem.contact.cohesive import COHESIVE, DAMAGE, SEPARATION, Cohesive
from pbem.contact.declaration import Slide
from pbem.contact.laws import collect_laws
from pbem.contact.softening import SOFTENINGS, Shape
from pbem.mesh.generate import generate_mesh
from pbem.results.model_text import describe_law
from tests.unit.case_sample import BLOCKS, build, change, find_faults, find_only_fault

SHAPES: tuple[Shape, ...] = ("linear", "exponential", "constant")
NUMBERS = {
    "friction": 0.3, "cohesion": 2.0, "tensile_strength": 1.5, "fracture_energy": 0.4, "fracture_energy_shear": 0.9,
}  # fmt: skip
PARAMETERS = {name: np.array([value]) for name, value in NUMBERS.items()}


def start(separation: float = 0.0) -> dict[str, np.ndarray]:
    return {SEPARATION.name: np.array([separation]), DAMAGE.name: np.zeros(1), "slip_path": np.zeros(1)}


@pytest.mark.parametrize("shape", SHAPES)
def test_a_shape_has_the_area_of_its_factor_and_its_slope(shape: Shape) -> None:
    soft = SOFTENINGS[shape]
    x = np.linspace(0.05, 0.95, 7)
    middle = (np.arange(80_000) + 0.5) * 40 / 80_000
    assert soft.factor * soft.traction(middle).sum() * 40 / 80_000 == pytest.approx(1, rel=1e-6)
    assert soft.factor * soft.area(np.array([40.0])) == pytest.approx(1)
    np.testing.assert_allclose((soft.traction(x + 1e-6) - soft.traction(x - 1e-6)) / 2e-6, soft.slope(x), atol=1e-8)
    np.testing.assert_allclose((soft.area(x + 1e-6) - soft.area(x - 1e-6)) / 2e-6, soft.traction(x), rtol=1e-8)
    np.testing.assert_allclose(soft.find_damage(np.array([0.0, 40.0])), [0, 1], atol=1e-12)


@pytest.mark.parametrize("shape", SHAPES)
def test_the_separation_of_trial_values(shape: Shape) -> None:
    soft, stiffness = SOFTENINGS[shape], np.full(5, 3.0)
    x = np.array([0.0, 0.2, 0.8, 1.5, 3.0])
    found = soft.find_separation(soft.traction(x) + stiffness * x, stiffness, np.zeros(5))
    np.testing.assert_allclose(found, x, atol=1e-12)
    below = np.array([0.7, -1.0, -30.0, -1e6])  # far below the strength, as where fluid presses faces apart elsewhere
    assert np.array_equal(soft.find_separation(below, np.full(4, stiffness[0]), np.zeros(4)), np.zeros(4))
    before = np.full(5, 0.6)  # below it bonds unload towards the origin
    x = np.array([0.0, 0.1, 0.3, 0.59, 0.9])
    traction = np.where(x < 0.6, soft.traction(before) * x / 0.6, soft.traction(x))
    np.testing.assert_allclose(soft.find_separation(traction + stiffness * x, stiffness, before), x, atol=1e-12)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("separation", [0.0, 0.3, 0.9])
def test_the_tangent_of_open_pairs_is_the_derivative(shape: Shape, separation: float) -> None:
    law = COHESIVE[shape]
    unit, step = law.find_units(PARAMETERS), 1e-7
    for along in ((0.3, 0.4), (0.6, -0.3), (0.0, 0.5), (0.45, 0.0)):
        jump = unit * np.array([along])
        found = law.separate(jump, start(separation), PARAMETERS)
        for column in range(2):
            change = np.eye(2)[column] * step * unit[0, column]
            if jump[0, 0] == 0 and column == 0:
                continue  # closed faces have another law
            ahead, behind = (law.separate(jump + sign * change, start(separation), PARAMETERS) for sign in (1, -1))
            slope = (ahead.traction - behind.traction)[0] / (2 * change[column])
            np.testing.assert_allclose(found.tangent[0, :, column], slope, rtol=1e-5, atol=1e-5)
        np.testing.assert_allclose(found.traction[0], found.secant[0] @ jump[0], rtol=1e-14)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("ratio", [0.0, 0.5, 2.0, np.inf])
def test_the_work_of_separation_is_the_fracture_energy_of_its_mode(shape: Shape, ratio: float) -> None:
    """Along a constant ratio of opening and slip, by a sum over the path: G_n/G_I + G_s/G_II = 1."""
    law = COHESIVE[shape]
    toward = np.array([1.0, ratio]) / np.hypot(1, ratio) if np.isfinite(ratio) else np.array([0.0, 1.0])
    way = law.find_units(PARAMETERS)[0] * toward
    count, last = 4000, 40.0
    x = (np.arange(count) + 0.5) * last / count
    many = {name: np.full(count, value) for name, value in NUMBERS.items()}
    memory = {SEPARATION.name: np.zeros(count)}
    traction = law.separate(x[:, None] * way, memory, many).traction
    work = (traction * way).sum(axis=0) * last / count
    energies = np.array([NUMBERS["fracture_energy"], NUMBERS["fracture_energy_shear"]])
    np.testing.assert_allclose(work / energies, toward**2, rtol=2e-4, atol=1e-12)
    # Half way: what is dissipated, and what unloading gives back.
    old, new, jump = start(), start(0.5), 0.5 * way[None]
    spent = law.dissipate_open(0 * jump, jump, old, new, PARAMETERS) + law.store(jump, new, PARAMETERS)
    fine = (np.arange(count) + 0.5) * 0.5 / count
    work = (law.separate(fine[:, None] * way, memory, many).traction * way).sum() * 0.5 / count
    assert spent == pytest.approx(work, rel=1e-4)


def test_faces_in_touch_slide_by_the_bond_that_is_left_and_by_friction() -> None:
    law = COHESIVE["linear"]
    unit = 2 * 0.9 / 2.0
    slide = Slide(np.array([0.25 * unit]), start(0.5))
    found = law.strength(np.array([-4.0]), slide, **PARAMETERS)
    assert found.bound == pytest.approx(2.0 * 0.25 + 0.3 * 4) and found.by_traction == pytest.approx(-0.3)
    assert found.by_slip == pytest.approx(-2.0 / unit)
    lost = law.strength(np.array([-4.0]), Slide(np.array([unit]), start(0.5)), **PARAMETERS)
    assert lost.bound == pytest.approx(1.2) and lost.by_slip == 0


def test_pairs_without_strength_have_no_bond() -> None:
    law, none = COHESIVE["exponential"], PARAMETERS | {"tensile_strength": np.zeros(1)}
    assert not law.find_live(start(), none) and DAMAGE.start(none) == 1
    assert law.separate(np.array([[0.1, 0.1]]), start(), none).traction == pytest.approx(0)
    assert law.strength(np.array([-1.0]), Slide(np.zeros(1), start()), **none).bound == pytest.approx(0.3)


LAW = 'law = "cohesive"\ntensile_strength = 1.5\nfracture_energy = 0.02\n'
CASE = change(BLOCKS, ('law = "coulomb"\nfriction = 0.5\n', LAW))


def test_the_numbers_reach_the_model() -> None:
    law = build(CASE).interfaces["interface"].law
    assert (law.kind, law.softening, law.friction, law.cohesion, law.tensile_strength) == (
        "cohesive", "linear", 0, 1.5, 1.5)
    assert dict(law.parameters) == {"fracture_energy": 0.02, "fracture_energy_shear": 0.02}
    more = "cohesion = 3\nfracture_energy_shear = 0.05\nsoftening = \"exponential\"\nfriction_angle = 45\n"
    model = build(change(CASE, (LAW, LAW + more)))
    law = model.interfaces["interface"].law
    assert law.cohesion == 3 and law.friction == pytest.approx(1) and law.parameters["fracture_energy_shear"] == 0.05
    assert "fracture energy shear 0.05" in describe_law(law) and "exponential softening" in describe_law(law)
    (group,) = collect_laws(model, generate_mesh(model)).strengths
    assert isinstance(group.law, Cohesive) and group.law is COHESIVE["exponential"]


WRONG = {
    "no energy": (("fracture_energy = 0.02\n", ""), "interfaces.interface", "without fracture_energy"),
    "no strength": (("tensile_strength = 1.5\n", ""), "interfaces.interface", "without tensile_strength"),
    "a negative energy": (("= 0.02", "= -0.02"), "interfaces.interface.fracture_energy", "-0.02"),
    "an energy of nothing": (("= 0.02", "= 0"), "interfaces.interface.fracture_energy", "0"),
    "a strength of nothing": (("= 1.5", "= 0"), "interfaces.interface.tensile_strength", "tensile_strength = 0"),
    "no shear strength": ((LAW, LAW + "cohesion = 0\n"), "interfaces.interface.cohesion", "cohesion = 0"),
    "a wrong shape": ((LAW, LAW + 'softening = "bilinear"\n'), "interfaces.interface.softening", "bilinear"),
    "another law's key": ((LAW, LAW + "rate_effect = 0.1\n"), "interfaces.interface.rate_effect", "rate_and_state"),
    "a slip distance": ((LAW, LAW + "slip_distance = 0.1\n"), "interfaces.interface.slip_distance", "no effect"),
    "a gap": ((LAW, LAW + "gap = 0.1\n"), "interfaces.interface.gap", "no effect"),
    "brittle too": ((LAW, LAW + "cohesion_lost = true\n"), "interfaces.interface.cohesion_lost", "no effect"),
    "an energy of coulomb": (('"cohesive"', '"coulomb"'), "interfaces.interface.fracture_energy", 'law = "cohesive"'),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_told(name: str) -> None:
    pair, place, told = WRONG[name]
    text = change(CASE, pair)
    if name == "an energy of coulomb":  # which may have a tensile strength
        assert len(find_faults(text)) >= 1
    message = find_only_fault(text)
    assert place in message and told in message
