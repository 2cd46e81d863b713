"""The modes of contact settle: junctions, crack fields, cohesion, loose bodies; or the true reason is said."""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from pbem.case.build import parse_model
from pbem.contact.laws import OPEN, SLIP, STICK
from pbem.errors import ConvergenceError
from pbem.mesh.generate import generate_mesh
from pbem.parallel import world
from pbem.solve.problem.step import ContactState, SilentReporter, Step
from pbem.solve.steps.march import march
from pbem.solve.system.assembly import assemble_problem
from tests.verification.proofs.crack_fields import scatter_cracks
from tests.verification.proofs.proof import line, write_case

Load = tuple[float, float, float]


class Listener(SilentReporter):
    """Keeps what a run says."""

    def __init__(self) -> None:
        self.notes: list[str] = []
        self.rejected: list[str] = []
        self.tried = 0

    def note(self, text: str) -> None:
        self.notes.append(text)

    def start_step(self, stage: int, reached: float, target: float) -> None:
        self.tried += 1

    def reject(self, reason: str, detail: str) -> None:
        self.rejected.append(reason)


def write_plane(
    curves: Mapping[str, Any], law: Mapping[str, Any], load: Load, size: float = 1.0, modulus: float = 1e3
) -> str:
    """Cracks in an infinite plane under remote stresses, in units in which lengths and moduli are so large."""
    stress = modulus / 1e3
    keys = ("sxx", "syy", "sxy")
    return write_case(
        {
            "materials": {"rock": {"young": modulus, "poisson": 0.25}},
            "curves": {
                name: {**curve, "points": [size * point for point in curve["points"]]}
                for name, curve in curves.items()
            },
            "regions": {"plane": {"material": "rock", "infinite": True, "cracks": list(curves)}},
            "interfaces": {name: dict(law) for name in curves},
            "remote": {key: stress * value for key, value in zip(keys, load, strict=True)},
            "analysis": {"steps": 1},
            "solver": {"operator": "dense"},
        }
    )


def run(text: str, listener: Listener | None = None) -> tuple[Step, ...]:
    """All steps of a case."""
    _, model = parse_model(text)
    problem = assemble_problem(model, generate_mesh(model), world)
    return tuple(march(problem, listener or Listener()))


def measure_breach(contact: ContactState, friction: float) -> float:
    """Largest breach of Coulomb's law of one step from rest, relative to the largest jump or traction."""
    mode, p_n, p_s = contact.mode, contact.traction_n, contact.traction_s
    stress = max(np.abs(p_n).max(), np.abs(p_s).max())
    length = max(np.abs(contact.opening).max(), np.abs(contact.slip).max()) or 1.0
    excess = np.abs(p_s) + friction * p_n
    breaches = [
        -contact.opening / length,
        np.where(mode == OPEN, np.hypot(p_n, p_s), p_n) / stress,
        np.where(mode == OPEN, 0.0, np.abs(contact.opening)) / length,
        np.where(mode == STICK, np.abs(contact.slip), 0.0) / length,
        np.where(mode == STICK, excess, np.where(mode == SLIP, np.abs(excess), 0.0)) / stress,
        np.where(mode == SLIP, -contact.slip * p_s, 0.0) / (length * stress),
    ]
    return float(max(breach.max() for breach in breaches))


def make_junction(*angles: float, elements: int = 16) -> dict[str, Any]:
    """Branches of length 1 from one point, graded towards both ends."""
    ends = [cmath.rect(1.0, math.radians(angle)) for angle in angles]
    return {
        f"b{k}": {**line(0j, end, elements), "grading": "both", "power": 3.0} for k, end in enumerate(ends)
    }


@pytest.mark.parametrize("friction", [0.0, 0.3, 0.8])
@pytest.mark.parametrize("load", [(1.0, -10.0, 0.0), (0.2, -1.0, 0.6), (-1.0, -1.0, 1.5)])
def test_three_branches_with_30_degrees_between_settle(load: Load, friction: float) -> None:
    (step,) = run(write_plane(make_junction(0, 30, 60), {"friction": friction}, load))
    assert len(step.iterations) <= 15
    assert measure_breach(step.contact, friction) <= 1e-8
    assert (step.contact.mode == OPEN).any() and (step.contact.mode == SLIP).any()


@pytest.mark.parametrize(
    ("load", "friction"), [((1.0, -10.0, 0.0), 0.3), ((0.2, -1.0, 0.6), 0.8), ((-1.0, -1.0, 1.5), 0.8)]
)
def test_friction_that_weakens_on_one_crack_leaves_the_others_to_pivoting(load: Load, friction: float) -> None:
    curves = make_junction(0, 30, 60, elements=12) | {"far": line(4 + 3j, 5 + 4j, 6)}
    head, tail = write_plane(curves, {"friction": friction}, load).split("\nfar = { friction = ")
    weakens = f"{friction}, friction_dynamic = {friction / 2}, slip_distance = 1e-3"
    steps = run(f"{head}\nfar = {{ friction = {weakens}{tail[tail.index(' }'):]}")
    assert [len(step.iterations) <= 12 for step in steps] == [True]


@pytest.mark.parametrize("load", [(1.0, -10.0, 0.0), (0.2, -1.0, 0.6), (-1.0, -1.0, 1.5)])
def test_pairs_of_weakening_friction_change_while_their_neighbours_are_pivoted(load: Load) -> None:
    text = write_plane(make_junction(0, 30, 60, elements=12), {"friction": 0.8}, load)
    weakens = "\nb0 = { friction = 0.8, friction_dynamic = 0.5, slip_distance = 0.01"
    steps = run(text.replace("\nb0 = { friction = 0.8", weakens))
    assert [len(step.iterations) <= 12 for step in steps] == [True]

LOADS: tuple[Load, ...] = ((1.0, -10.0, 0.0), (0.3, -1.0, 0.2), (-0.3, 1.0, 0.2), (1.0, -1.0, 0.0), (-1.0, -3.0, 1.0))


def test_crack_fields_settle_under_mixed_loads() -> None:
    counts = []
    for seed in range(10):
        friction = 1.2 * seed / 9
        cracks = {f"c{k}": line(*ends, 3) for k, ends in enumerate(scatter_cracks(100 + seed, 16))}
        (step,) = run(write_plane(cracks, {"friction": friction}, LOADS[seed % len(LOADS)]))
        assert measure_breach(step.contact, friction) <= 1e-8, seed
        counts.append(len(step.iterations))
    assert np.median(counts) <= 6 and max(counts) <= 15, counts


UNITS = [(1.0, 1e3), (2.0**10, 2.0**30 * 1e3), (2.0**-20, 2.0**-8 * 1e3), (1e3, 1.0), (1e-6, 1e9)]


def test_units_take_the_same_iterations_and_modes() -> None:
    steps = []
    for size, modulus in UNITS:
        text = write_plane(make_junction(0, 30, 60, elements=12), {"friction": 0.8}, (0.2, -1.0, 0.6), size, modulus)
        (step,) = run(text)
        steps.append(step)
    usual = steps[0]
    for step in steps[1:]:
        assert [each.changed for each in step.iterations] == [each.changed for each in usual.iterations]
        np.testing.assert_array_equal(step.contact.mode, usual.contact.mode)


def write_inclusion(friction: float, load: Load) -> str:
    """A disc of the plane's own material, loose in its hole."""
    return write_case(
        {
            "materials": {"m": {"young": 1e3, "poisson": 0.2}},
            "curves": {"i": {"center": [0.0, 0.0], "radius": 1.0, "elements": 20}},
            "regions": {
                "disc": {"material": "m", "boundary": ["i"]},
                "plane": {"material": "m", "boundary": ["i"], "infinite": True},
            },
            "interfaces": {"i": {"law": "coulomb", "friction": friction}},
            "remote": dict(zip(("sxx", "syy", "sxy"), load, strict=True)),
            "analysis": {"steps": 1},
        }
    )


@pytest.mark.parametrize("friction", [0.1, 0.3, 0.7])
@pytest.mark.parametrize("load", [(0.2, 1.0, 0.0), (0.0, 1.0, 0.3)])
def test_a_loose_inclusion_under_tension_is_held_by_balanced_friction(load: Load, friction: float) -> None:
    _, model = parse_model(write_inclusion(friction, load))
    mesh = generate_mesh(model)
    (step,) = march(assemble_problem(model, mesh, world), SilentReporter())
    assert len(step.iterations) <= 25
    contact = step.contact
    assert measure_breach(contact, friction) <= 1e-8
    assert (contact.mode == OPEN).any() and (contact.mode != OPEN).any()
    # Nothing but contact holds the disc: what it carries has no resultant and no moment.
    pairs = mesh.pairs
    force = (contact.traction_n + 1j * contact.traction_s) * pairs.normal * pairs.weight
    scale = np.abs(force).sum()
    assert abs(force.sum()) <= 1e-3 * scale
    assert abs((np.conj(pairs.position) * force).imag.sum()) <= 1e-3 * scale


def write_cohesive_field(lost: bool) -> str:
    """Ten random cracks under tension: cohesion without tensile strength."""
    return f"""
materials.host = {{ young = 1000.0, poisson = 0.2 }}
regions.host = {{ material = "host", infinite = true }}
remote = {{ sxx = 0.2, syy = 1.0 }}
analysis.steps = 1
solver = {{ min_step = 0.6, operator = "dense" }}
[[generate]]
kind = "cracks"
name = "crack"
count = 10
half_length = 1.0
density = 0.15
distance = 0.05
elements = 4
seed = 33
region = "host"
friction = 0.1
cohesion = 0.2
cohesion_lost = {str(lost).lower()}
"""


def test_cohesion_without_admissible_modes_is_named_and_the_advice_works() -> None:
    with pytest.raises(ConvergenceError, match=r"of these 6: on crack_1 at .*cohesion_lost = true") as caught:
        run(write_cohesive_field(False))
    assert caught.value.reason == "no admissible modes"
    (step,) = run(write_cohesive_field(True))
    assert step.factor == 1.0


def test_cohesion_without_admissible_modes_at_small_loads_is_not_halved_towards() -> None:
    """Loads far below the cohesion: faces part or stick, the same at every fraction, of which the least is tried. Bonds
    that are lost for good hold in the end."""
    listener, bond = Listener(), 'law = "coulomb", cohesion = 9.0, tensile_strength = 9.0, cohesion_lost = true'
    text = write_cohesive_field(False).replace("min_step = 0.6, ", "") + f"[interfaces]\ncrack_9 = {{ {bond} }}\n"
    with pytest.raises(ConvergenceError, match=r"the step to 0\.0001 failed and is the smallest allowed") as caught:
        run(text, listener)
    assert caught.value.reason == "no admissible modes"
    assert listener.tried == 3 and len(listener.rejected) == 2


WEAKENING_INCLUSIONS = """
[materials]
rock = { young = 0.246, poisson = 0.375, plane = "stress" }
grain = { young = 1.985, poisson = 0.154, plane = "stress" }
[curves]
bottom = { points = [[-30.022, -8.655], [-18.483, -4.377]], elements = 8 }
right = { points = [[-18.483, -4.377], [-22.761, 7.163]], elements = 8 }
top = { points = [[-22.761, 7.163], [-34.301, 2.884]], elements = 8 }
left = { points = [[-34.301, 2.884], [-30.022, -8.655]], elements = 8 }
i0 = { center = [-24.858, 1.214], radius = 1.771, angles = [20.0, 380.0], elements = 20 }
i1 = { points = CORNERS, elements = 20 }
i2 = { center = [-29.068, -1.039], radius = 1.703, angles = [20.0, 380.0], elements = 24 }
[regions]
g0 = { material = "grain", boundary = ["i0"] }
g1 = { material = "grain", boundary = ["i1"] }
g2 = { material = "grain", boundary = ["i2"] }
body = { material = "rock", boundary = ["bottom", "right", "top", "left", "i0", "i1", "i2"] }
[interfaces]
i0 = { law = "coulomb", friction = 0.766, friction_dynamic = 0.343, slip_distance = 4.67e-5, gap = 2.62e-4, JOINT }
i1 = { law = "coulomb", friction = 0.766, friction_dynamic = 0.343, slip_distance = 4.67e-5, gap = 4.31e-5, JOINT }
i2 = { law = "coulomb", friction = 0.766, friction_dynamic = 0.343, slip_distance = 4.67e-5, gap = 1.22e-4, JOINT }
[boundary]
bottom = { un = 0.0, us = 0.0 }
left = { tn = -2.83e-5, ts = 0.0 }
right = { tn = -2.83e-5, ts = 0.0 }
top = { tn = -2.93e-5, ts = 0.0 }
[analysis]
order = 2
scheme = "DBEM"
steps = 1
""".replace(
    "CORNERS", "[[-26.85, -2.39], [-27.03, -4.18], [-25.39, -4.91], [-24.19, -3.57], [-25.09, -2.01], [-26.85, -2.39]]"
).replace("JOINT", "normal_stiffness = 1.087, tangential_stiffness = 0.653")


def test_steep_weakening_on_loose_bodies_settles_in_few_iterations() -> None:
    """Friction that falls by half in a fifth of the slip: Newton's steps do not end, nor do their states come back; the
    pairs that run on by themselves come to rest."""
    listener = Listener()
    (step,) = run(WEAKENING_INCLUSIONS, listener)
    assert not listener.rejected and len(step.iterations) <= 12
    contact = step.contact
    slips = contact.mode == SLIP
    slid = np.abs(contact.slip - contact.traction_s / 0.653)
    friction = 0.766 - (0.766 - 0.343) * np.minimum(slid / 4.67e-5, 1.0)
    error = np.abs(np.abs(contact.traction_s) + friction * contact.traction_n)[slips]
    assert slips.sum() > 10 and error.max() <= 1e-7 * np.abs(contact.traction_n).max()


def test_elements_that_cannot_carry_contact_are_named() -> None:
    # Two faces at a fifteenth of an element's length from each other.
    curves = {"upper": line(-1 + 0.03j, 1 + 0.03j, 4, "none"), "lower": line(-0.8 + 0j, 1.1 + 0j, 5, "none")}
    with pytest.raises(ConvergenceError, match=r"open under compression.*on (upper|lower) at") as caught:
        run(write_plane(curves, {"friction": 0.3}, (-0.3, 1.0, 0.2)))
    assert caught.value.reason == "unsound mesh"


BLOCKS = {
    "materials": {"m": {"young": 1e3, "poisson": 0.2}},
    "curves": {
        "bottom": line(0j, 2 + 0j, 6), "right_low": line(2 + 0j, 2 + 1j, 4), "joint": line(0 + 1j, 2 + 1j, 8),
        "left_low": line(0j, 1j, 4), "right_up": line(2 + 1j, 2 + 2j, 4), "top": line(2j, 2 + 2j, 6),
        "left_up": line(1j, 2j, 4),
    },
    "regions": {
        "lower": {"material": "m", "boundary": ["bottom", "right_low", "joint", "left_low"]},
        "upper": {"material": "m", "boundary": ["joint", "right_up", "top", "left_up"]},
    },
    "interfaces": {"joint": {"law": "coulomb", "friction": 0.25}},
    "boundary": {"bottom": {"ux": 0.0, "uy": 0.0}},
}  # fmt: skip


def write_pushed_blocks(shear: float, stages: bool) -> str:
    """A block on another one, pressed and pushed by tractions; in two stages or all at once."""
    last = {"name": "push", "steps": 1, "boundary": {"top": {"tx": shear, "ty": -1.0}}}
    first = {"name": "press", "steps": 1, "boundary": {"top": {"tx": 0.0, "ty": -1.0}}}
    return write_case(BLOCKS | {"stages": [first, last] if stages else [last], "solver": {"min_step": 0.02}})


def test_the_largest_load_is_found_and_said() -> None:
    # Friction bears 0.25 of the pressure.
    listener = Listener()
    with pytest.raises(ConvergenceError, match=r"limit load reached at fraction 0.6.*translation along x") as caught:
        run(write_pushed_blocks(0.4, stages=True), listener)
    assert caught.value.reason == "limit load"
    assert listener.rejected  # the way to it is by halved steps


def test_a_step_in_proportion_from_rest_is_not_halved() -> None:
    listener = Listener()
    with pytest.raises(ConvergenceError, match=r"fails at every fraction.*translation along x of 'upper'") as caught:
        run(write_pushed_blocks(0.4, stages=False), listener)
    assert caught.value.reason == "free motion"
    assert listener.tried == 1 and not listener.rejected
    (step,) = run(write_pushed_blocks(0.2, stages=False))
    assert step.factor == 1.0
