"""Elastic joints under in-situ stress: they have closed under it before any load, and nothing moves until one acts."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pbem
from pbem.solve.problem.step import SilentReporter

pytestmark = pytest.mark.usefixtures("without_errors")

# Of the joint: initial stiffness, largest closure of one that stiffens; in-situ stress down the column, and across.
STIFFNESS, CLOSURE, ACROSS = 2e3, 4e-3, 2.0
LAWS: dict[str, dict[str, Any]] = {
    "linear": {"law": "coulomb", "friction": 0.5},
    "stiffens": {"law": "barton_bandis", "residual_friction_angle": 30.0, "jrc": 8.0, "jcs": 50.0, "closure": CLOSURE},
    "bonded": {"law": "bonded"},
}


def make_column(law: str, angle: float, unit: float, stress: float, shear: float, stages: list[dict]) -> dict[str, Any]:
    """Blocks 1 and 2 high between smooth walls on the left, below and above, turned and in other units; Poisson 0."""
    turn = np.exp(1j * math.radians(angle)) * unit

    def place(*points: complex) -> list[list[float]]:
        return [[float((point * turn).real), float((point * turn).imag)] for point in points]

    c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    rotation = np.array([[c, -s], [s, c]])
    tensor = rotation @ np.array([[0.0, shear], [shear, -ACROSS]]) @ rotation.T * stress
    rest = {"sxx": tensor[0, 0], "syy": tensor[1, 1], "sxy": tensor[0, 1]}
    ends = {"below": (0, 1), "right": (1, 1 + 1j), "joint": (1 + 1j, 1j), "left": (1j, 0), "beside": (1 + 1j, 1 + 3j),
            "top": (1 + 3j, 3j), "beyond": (3j, 1j)}
    stiff = {"normal_stiffness": STIFFNESS * stress / unit, "tangential_stiffness": STIFFNESS * stress / unit}
    given = {key: value * stress if key == "jcs" else value * unit if key == "closure" else value
             for key, value in LAWS[law].items()}
    wall = {"un": 0.0, "us": 0.0} if shear else {"un": 0.0, "ts": 0.0}
    return {
        "materials": {"soft": {"young": 1e3 * stress, "poisson": 0.0}, "hard": {"young": 4e3 * stress, "poisson": 0.0}},
        "curves": {name: {"points": place(*points), "elements": 3} for name, points in ends.items()},
        "regions": {"lower": {"material": "soft", "boundary": ["below", "right", "joint", "left"]},
                    "upper": {"material": "hard", "boundary": ["joint", "beside", "top", "beyond"]}},
        "boundary": {name: wall for name in (set(ends) - {"joint"} if shear else ("below", "left", "beyond", "top"))},
        "interfaces": {"joint": given | stiff},
        "initial_stress": {"soft": rest, "hard": rest},
        "stages": stages,
    }  # fmt: skip


def close(law: str, pressure: float) -> float:
    """The closure of the joint under a pressure (theory, 112)."""
    return pressure / (STIFFNESS + (pressure / CLOSURE if law == "stiffens" else 0.0))


def store(law: str, pressure: float) -> float:
    """The energy that it stores under a pressure (theory, 113)."""
    part = close(law, pressure) / CLOSURE
    return STIFFNESS * CLOSURE**2 * (-math.log1p(-part) - part) if law == "stiffens" else pressure**2 / (2 * STIFFNESS)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(("angle", "unit", "stress"), [(0.0, 1.0, 1.0), (33.0, 1e-3, 1e6)])
def test_nothing_moves_at_rest(law: str, angle: float, unit: float, stress: float, tmp_path: Path) -> None:
    case = make_column(law, angle, unit, stress, 0.3, [{"steps": 1}])
    results = pbem.run(case, tmp_path / "rest.h5")
    joint = results.contact["joint"]
    assert np.abs(results.displacement[-1]).max() < 1e-12 * unit
    np.testing.assert_allclose(joint.traction_n[-1], -ACROSS * stress, rtol=1e-9)
    np.testing.assert_allclose(np.abs(joint.traction_s[-1]), 0.3 * stress, rtol=1e-9)
    np.testing.assert_allclose(joint.opening[-1], -close(law, ACROSS) * unit, rtol=1e-9)
    assert abs(results.energy.external[-1]) + abs(results.energy.elastic[-1]) < 1e-12 * stress * unit**2
    assert results.energy.dissipated[-1] < 1e-12 * stress * unit**2


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(("angle", "unit", "stress"), [(0.0, 1.0, 1.0), (33.0, 1e-3, 1e6)])
def test_a_joint_closes_on_from_where_it_was(
    law: str, angle: float, unit: float, stress: float, tmp_path: Path
) -> None:
    """Blocks in series with the joint, pressed together by a thousandth more."""
    stages = [{"steps": 1}, {"steps": 40, "boundary": {"top": {"un": -1e-3 * unit}}}]
    results = pbem.run(make_column(law, angle, unit, stress, 0.0, stages), tmp_path / "column.h5")
    blocks, low, high = 1 / 1e3 + 2 / 4e3, ACROSS, 2 * ACROSS
    for _ in range(60):
        pressure = 0.5 * (low + high)
        pushed = (pressure - ACROSS) * blocks + close(law, pressure) - close(law, ACROSS)
        low, high = (pressure, high) if pushed < 1e-3 else (low, pressure)
    np.testing.assert_allclose(results.contact["joint"].traction_n[-1], -low * stress, rtol=1e-8)
    np.testing.assert_allclose(results.contact["joint"].opening[-1], -close(law, low) * unit, rtol=1e-8)
    stored = 0.5 * (low**2 - ACROSS**2) * blocks + store(law, low) - store(law, ACROSS)
    assert results.energy.elastic[-1] == pytest.approx(stored * stress * unit**2, rel=1e-8)
    assert results.energy.external[-1] == pytest.approx(stored * stress * unit**2, rel=1e-5)
    assert results.energy.released[-1] == 0.0


@pytest.mark.parametrize("angle", [0.0, 33.0])
def test_a_joint_that_is_pulled_open_gives_back_its_closure(angle: float, tmp_path: Path) -> None:
    """Faces part once blocks and joint have stretched by what the in-situ stress had taken of them."""
    stages = [{"steps": 1}, {"steps": 4, "boundary": {"top": {"un": 6e-3}}}]
    joint = pbem.run(make_column("linear", angle, 1.0, 1.0, 0.0, stages), tmp_path / "open.h5").contact["joint"]
    blocks = 1 / 1e3 + 2 / 4e3
    np.testing.assert_allclose(joint.traction_n[-1], 0.0, atol=1e-9)
    np.testing.assert_allclose(joint.opening[-1], 6e-3 - ACROSS * (blocks + 1 / STIFFNESS), rtol=1e-8)


@pytest.mark.parametrize("across", [0.0, 0.5])
def test_strength_holds_faces_that_are_pulled_at_rest(
    across: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where the normal traction is zero but for rounding, in any orientation."""
    monkeypatch.setitem(LAWS, "strong", {"law": "coulomb", "friction": 0.5, "cohesion": 1.0, "tensile_strength": 1.0})
    monkeypatch.setattr(sys.modules[__name__], "ACROSS", -across)
    for angle in (0.0, 33.0, 71.0):
        results = pbem.run(make_column("strong", angle, 1.0, 1.0, 0.3, [{"steps": 1}]), tmp_path / f"{angle}.h5")
        assert np.abs(results.displacement[-1]).max() < 1e-12


def test_a_crack_at_rest_gives_no_note_of_overlap(tmp_path: Path) -> None:
    """What a joint has closed by does not vanish at the tips, as jumps do between the nodes."""
    notes: list[str] = []

    class Noting(SilentReporter):
        def note(self, text: str) -> None:
            notes.append(text)

    case = {
        "materials": {"rock": {"young": 1e3, "poisson": 0.2}},
        "curves": {"crack": {"points": [[-1, 0], [1, 0]], "elements": 8}},
        "regions": {"plane": {"material": "rock", "infinite": True, "cracks": ["crack"]}},
        "interfaces": {"crack": {"friction": 0.5, "normal_stiffness": 2e3, "tangential_stiffness": 2e3}},
        "initial_stress": {"rock": {"sxx": -1.0, "syy": -2.0}},
        "stages": [{"steps": 1}],
    }
    results = pbem.run(case, tmp_path / "crack.h5", reporter=Noting())
    np.testing.assert_allclose(results.contact["crack"].opening[0], -1e-3, rtol=1e-9)
    assert not [note for note in notes if "overlap" in note]


def test_cohesive_joints_store_nothing_at_rest_along_their_faces(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They take the in-situ stress as a load, as their law counts all jumps: energies are those of blocks and joint in
    series, which give way to it."""
    monkeypatch.setitem(LAWS, "cohesive", {
        "law": "cohesive", "friction": 0.5, "tensile_strength": 1.0, "cohesion": 1.0, "fracture_energy": 1e-2,
        "fracture_energy_shear": 1e-2,
    })  # fmt: skip
    energy = pbem.run(make_column("cohesive", 0.0, 1.0, 1.0, 0.0, [{"steps": 1}]), tmp_path / "pressed.h5").energy
    blocks, joint = 1 / 1e3 + 2 / 4e3, 1 / STIFFNESS
    left = ACROSS * blocks / (blocks + joint)
    stored = 0.5 * (left**2 - ACROSS**2) * blocks + 0.5 * left**2 * joint
    assert energy.elastic[-1] == pytest.approx(stored, rel=1e-8) == energy.external[-1]
    # With shear between walls that hold all motions.
    energy = pbem.run(make_column("cohesive", 0.0, 1.0, 1.0, 0.3, [{"steps": 1}]), tmp_path / "sheared.h5").energy
    assert abs(energy.elastic[-1]) < -stored and energy.external[-1] == pytest.approx(energy.elastic[-1], rel=1e-8)
