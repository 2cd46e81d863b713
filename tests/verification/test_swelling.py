"""Heated and swollen bodies against exact solutions: Eshelby's inclusion, Lame's ring, bodies that are free to grow."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pbem
from pbem.geometry.expression import is_linear
from pbem.results.field_values import VertexField
from pbem.results.region_triangles import triangulate
from tests.unit.test_plots_field import make_view

pytestmark = pytest.mark.usefixtures("without_errors")

FINE = {"elements": 24}


def shear_modulus(material: dict[str, Any]) -> float:
    return material["young"] / (2 * (1 + material["poisson"]))


def make_inclusion(center: complex, radius: float, inside: dict[str, Any], order: int, **more: Any) -> dict[str, Any]:
    """A circle in an infinite plane, bonded; points inside and outside."""
    x, y = center.real, center.imag
    return {
        "materials": {"inside": inside, "outside": {"young": 3e3, "poisson": 0.2}},
        "curves": {"circle": {"center": [x, y], "radius": radius, **FINE}},
        "regions": {"plane": {"material": "outside", "infinite": True, "boundary": ["circle"]},
                    "core": {"material": "inside", "boundary": ["circle"]}},
        "analysis": {"order": order, "steps": 2},
        "output": {"points": [[x + 0.3 * radius, y - 0.5 * radius], [x, y + 2 * radius]]},
        **more,
    }  # fmt: skip


@pytest.mark.parametrize(("center", "radius"), [(0j, 1.0), (3e6 - 2e5j, 40.0)])
@pytest.mark.parametrize("order", [1, 2, 3])
@pytest.mark.parametrize("operator", ["dense", "hierarchical"])
def test_heated_inclusion(center: complex, radius: float, order: int, operator: str, tmp_path: Path) -> None:
    """Pressure p (1/(2 G_out) + (1 - 2 nu)/(2 G_in)) = (1 + nu) alpha T; outside it falls with the square of a/r."""
    inside = {"young": 7e3, "poisson": 0.3, "expansion": 1.2e-5}
    case = make_inclusion(center, radius, inside, order, temperature={"core": 80.0}, solver={"operator": operator})
    results = pbem.run(case, tmp_path / "heated.h5")
    strain = 1.3 * 1.2e-5 * 80
    pressure = strain / (1 / (2 * 3e3 / 2.4) + 0.4 / (2 * shear_modulus(inside)))
    accuracy = {1: 3e-3, 2: 3e-5, 3: 1e-5}[order] * pressure
    stress = results.interior.stress
    np.testing.assert_allclose(stress[-1][0], [-pressure, -pressure, 0], atol=accuracy)
    np.testing.assert_allclose(stress[-1][1], [pressure / 4, -pressure / 4, 0], atol=accuracy)
    np.testing.assert_allclose(stress[0], 0.5 * stress[1], atol=1e-6 * pressure)
    after = results.evaluate(results.interior.position)
    np.testing.assert_allclose(after.stress, stress, atol=accuracy)
    np.testing.assert_allclose(after.displacement, results.interior.displacement, atol=1e-3 * strain * radius)
    # What swelling does against the pressure is stored, by half of p times the misfit along the circle.
    stored = np.pi * radius**2 * pressure * strain
    assert results.energy.elastic[-1] == pytest.approx(stored, rel=1e-2 if order == 1 else 1e-4)
    assert results.energy.external[-1] == pytest.approx(results.energy.elastic[-1], rel=1e-5)


def test_inclusion_that_changes_its_shape(tmp_path: Path) -> None:
    """Eshelby's cylinder in a plane of its own material: sxy = -G exy/(2 (1 - nu)), sxx - syy alike, none outside."""
    material = {"young": 3e3, "poisson": 0.2}
    strain = {"exx": 2e-3, "eyy": -2e-3, "exy": 1e-3}
    results = pbem.run(make_inclusion(0j, 2.0, material, 2, eigenstrain={"core": strain}), tmp_path / "sheared.h5")
    factor = -shear_modulus(material) / (2 * (1 - 0.2))
    exact = np.array([2e-3 * factor, -2e-3 * factor, 1e-3 * factor])
    np.testing.assert_allclose(results.interior.stress[-1][0], exact, atol=1e-4 * np.abs(exact).max())


def test_inclusion_that_swells_more_on_one_side(tmp_path: Path) -> None:
    """exx = eyy = g X in a plane of the same material: stresses from the potential A (X r^2 - 2 a^2 X) inside and
    -A a^4 X/r^2 outside, A = g/(8 (1 - nu)), by 2 G (d_ij - delta_ij laplace)."""
    material, (x, y), radius, by = {"young": 3e3, "poisson": 0.2}, (30.0, -7.0), 2.0, 1e-3
    strain = {"expression": f"{by}*(x - {x})"}
    case = make_inclusion(complex(x, y), radius, material, 2, eigenstrain={"core": {"exx": strain, "eyy": strain}})
    results = pbem.run(case, tmp_path / "graded.h5")
    size = 2 * shear_modulus(material) * by / (8 * (1 - 0.2))
    inside = np.array([-2 * 0.3, -6 * 0.3, 2 * -0.5]) * radius * size  # at (0.3, -0.5) a
    np.testing.assert_allclose(results.interior.stress[-1][0], inside, atol=2e-5 * np.abs(inside).max())
    # At (0, 2) a: x/r^2 has d_xx = d_yy = 0 there, and d_xy = -2/y^3.
    np.testing.assert_allclose(results.interior.stress[-1][1], [0.0, 0.0, size * radius / 4], atol=1e-5 * size * radius)


def make_ring(plane: str, **more: Any) -> dict[str, Any]:
    return {
        "materials": {"steel": {"young": 2.1e5, "poisson": 0.3, "plane": plane, "expansion": 1.1e-5}},
        "curves": {"inner": {"center": [5, 5], "radius": 20.0, **FINE},
                   "outer": {"center": [5, 5], "radius": 30.0, **FINE}},
        "regions": {"ring": {"material": "steel", "boundary": ["inner", "outer"]}},
        "analysis": {"steps": 1}, "output": {"points": [[5.0, 31.0], [-16.0, -8.0]]},
        **more,
    }  # fmt: skip


@pytest.mark.parametrize("plane", ["strain", "stress"])
def test_heated_ring_in_a_rigid_hole(plane: str, tmp_path: Path) -> None:
    """Lame: u = (e + A) r + B/r, free inside, held outside."""
    case = make_ring(plane, boundary={"outer": {"un": 0.0}}, temperature={"ring": 100.0})
    results = pbem.run(case, tmp_path / "ring.h5")
    young, nu = (2.1e5 / (1 - 0.09), 0.3 / 0.7) if plane == "strain" else (2.1e5, 0.3)
    strain = 1.1e-5 * 100 * (1.3 if plane == "strain" else 1.0)
    a, b = 20.0, 30.0
    # Plane stress in the moduli above: srr = E (A/(1 - nu) - B/((1 + nu) r^2)).
    A = -strain / (1 + (1 + nu) / (1 - nu) * (a / b) ** 2)
    B = A * (1 + nu) / (1 - nu) * a**2
    for point, stress in zip(results.interior.position, results.interior.stress[-1], strict=True):
        away = complex(point[0] - 5, point[1] - 5)
        mean, half = young * A / (1 - nu), -young * B / ((1 + nu) * abs(away) ** 2)
        turned = half * (away / abs(away)) ** 2
        exact = [mean + turned.real, mean - turned.real, turned.imag]
        np.testing.assert_allclose(stress, exact, atol=1e-4 * abs(mean))


def test_a_free_body_grows_without_stress(tmp_path: Path) -> None:
    """Temperature and eigenstrain linear in x and y: no stress, no K, no T; a cracked ring, pinned by nothing."""
    strain = {"exx": {"expression": "1e-4 + 3e-6*x"}, "eyy": {"expression": "2e-5*(x - 0.4*y)"},
              "exy": {"expression": "-1e-5*x + 2e-5*y"}, "ezz": 2e-4}
    case = make_ring("strain", temperature={"ring": {"expression": "40 + 2*x - y"}}, eigenstrain={"ring": strain})
    case["curves"]["crack"] = {"points": [[28, 6], [32, 7]], "elements": 8}
    case["regions"]["ring"]["cracks"] = ["crack"]
    results = pbem.run(case, tmp_path / "free.h5")
    hot = 2.1e5 * 1.1e-5 * 100
    assert np.abs(results.interior.stress).max() < 1e-6 * hot
    assert np.abs(results.hoop_stress).max() < 1e-4 * hot
    tip = results.tips["crack"]
    assert max(np.abs(tip.KI).max(), np.abs(tip.KII).max()) < 1e-6 * hot
    assert np.abs(tip.T).max() < 1e-3 * hot


def test_a_disc_that_grows_closes_its_gap(tmp_path: Path) -> None:
    """A loose disc in a hole with clearance: no stress until it fills the hole, then as bonded for the rest.

    Without friction, as a loose disc may lean on the hole before it fills it.
    """
    inside = {"young": 7e3, "poisson": 0.3, "expansion": 1e-5}
    stages = [{"temperature": {"core": 50.0}, "steps": 1}, {"temperature": {"core": 180.0}, "steps": 2}]
    law = {"circle": {"law": "frictionless", "gap": 1.3e-3}}
    case = make_inclusion(0j, 1.0, inside, 2, interfaces=law, stages=stages)
    results = pbem.run(case, tmp_path / "disc.h5")
    strain = 1.3e-5 * (180 - 100)
    pressure = strain / (1 / (2 * 3e3 / 2.4) + 0.4 / (2 * shear_modulus(inside)))
    assert np.abs(results.interior.stress[0]).max() < 1e-9 * pressure
    np.testing.assert_allclose(results.contact["circle"].traction_n[-1], -pressure, rtol=1e-3)


FAULTS = {
    "of no region": ({"temperature": {"cor": 1.0}}, "did you mean 'core'"),
    "of a plane": ({"eigenstrain": {"plane": {"exx": 1.0}}}, "of the infinite region"),
    "without expansion": ({"temperature": {"core": 1.0}}, "does not expand"),
    "not linear": ({"temperature": {"core": {"expression": "x*y"}}}, "not linear"),
    "misfit not linear": ({"eigenstrain": {"core": {"exy": {"expression": "x**2"}}}}, "core.exy: .* not linear"),
    "misfit not finite": ({"eigenstrain": {"core": {"exx": {"expression": "1e400*x"}}}}, "core.exx: .* finite values"),
    "misfit without value": ({"eigenstrain": {"core": {"eyy": {"expression": "log(-x*x)"}}}}, "core.eyy: .* nan "),
    "misfit as a table": ({"eigenstrain": {"core": {"exx": {"table": [[0, 1], [1, 2]]}}}}, "core.exx"),
    "of a stage": ({"stages": [{"eigenstrain": {"circle": {"exx": 1.0}}}]}, "stages"),
}


@pytest.mark.parametrize("kind", FAULTS)
def test_wrong_swelling_is_told(kind: str) -> None:
    tables, text = FAULTS[kind]
    material = {"young": 7e3, "poisson": 0.3} | ({"expansion": 1.0} if kind == "not linear" else {})
    with pytest.raises(pbem.CaseError, match=text):
        pbem.run(make_inclusion(0j, 1.0, material, 2, **tables))


def test_stages_keep_components_and_steps_between_are_right(tmp_path: Path) -> None:
    """A clamped square: sxx = -E'(exx + nu' eyy) and so on, of both components once both were given."""
    def line(a: tuple[int, int], b: tuple[int, int]) -> dict[str, Any]:
        return {"points": [a, b], "elements": 4}

    case = {
        "materials": {"m": {"young": 1000.0, "poisson": 0.25, "expansion": 1e-5}},
        "curves": {"b": line((0, 0), (1, 0)), "r": line((1, 0), (1, 1)), "t": line((1, 1), (0, 1)),
                   "l": line((0, 1), (0, 0))},
        "regions": {"a": {"material": "m", "boundary": ["b", "r", "t", "l"]}},
        "boundary": {name: {"ux": 0.0, "uy": 0.0} for name in "brtl"},
        "eigenstrain": {"a": {"exx": 1e-3}},
        "stages": [{"steps": 1}, {"steps": 1, "eigenstrain": {"a": {"eyy": 2e-3}}},
                   {"steps": 1, "eigenstrain": {"a": {"exx": 0.0, "eyy": 0.0}}, "temperature": {"a": 100.0}}],
        "output": {"points": [[0.4, 0.6]]},
    }
    results = pbem.run(case, tmp_path / "square.h5")
    lame, twice_shear = 1000 * 0.25 / (1.25 * 0.5), 1000 / 1.25
    for step, (exx, eyy) in ((0, (1e-3, 0.0)), (1, (1e-3, 2e-3))):
        trace = lame * (exx + eyy)
        exact = [-trace - twice_shear * exx, -trace - twice_shear * eyy, 0.0]
        np.testing.assert_allclose(results.interior.stress[step][0], exact, atol=1e-9)
    # All is held alike in the end: the stress is hydrostatic, and there is nothing for von Mises.
    triangles = triangulate(results.elements, np.array([False]), make_view(results))
    values = VertexField(results, triangles).evaluate([2])
    np.testing.assert_allclose(values.stress[0], [[-2.0, -2.0, 0.0, -2.0]] * values.stress.shape[1], atol=1e-6)


def test_linear_is_as_it_is_written() -> None:
    for text, right in (("20 + 3*x - y/2", True), ("sin(1)*x", True), ("abs(y)", False), ("x*y", False),
                        ("max(0, 1 - abs(y - 1.6)/0.1)", False), ("x**1.0", False), ("-(x + 2)*3", True)):
        assert is_linear(text, ("x", "y")) is right, text


def test_parallel_stress_of_a_crack_under_a_graded_temperature(tmp_path: Path) -> None:
    """T follows at the tip's own place: as coarse meshes tell it, so do fine ones."""
    found = []
    for elements in (6, 24):
        case = make_ring("strain", boundary={"outer": {"un": 0.0}, "inner": {"un": 0.0, "us": 0.0}},
                         temperature={"ring": {"expression": "10 + 3*(x - 5)"}})
        case["curves"]["crack"] = {"points": [[28, 6], [32, 7]], "elements": elements}
        case["regions"]["ring"]["cracks"] = ["crack"]
        found.append(pbem.run(case, tmp_path / "graded.h5", force=True).tips["crack"].T[-1])
    np.testing.assert_allclose(found[0], found[1], rtol=2e-3)


def heat_block(far: float, mirrored: bool) -> dict[str, Any]:
    """A hot block on a cold one, which is held below; so far from them a third one that nothing acts on."""
    def outline(name: str, x: float, y: float, width: float, height: float) -> dict[str, Any]:
        corners = [[x, y], [x + width, y], [x + width, y + height], [x, y + height]]
        return {f"{name}{k}": {"points": [corners[k], corners[(k + 1) % 4]], "elements": 4} for k in range(4)}

    curves = outline("a", 0.0, 0.0, 2.0, 1.0) | outline("u", 0.3, 1.0, 1.0, 0.7)
    del curves["a2"], curves["u0"]
    for name, start, end in (("left", 0.0, 0.3), ("seat", 0.3, 1.3), ("right", 1.3, 2.0)):
        curves[name] = {"points": [[start, 1.0], [end, 1.0]], "elements": 4}
    regions = {"base": {"material": "m", "boundary": ["a0", "a1", "a3", "left", "seat", "right"]},
               "hot": {"material": "m", "boundary": ["seat", "u1", "u2", "u3"]}}
    boundary = {"a0": {"ux": 0.0, "uy": 0.0}}
    if far:
        curves |= outline("f", -far, -far, 1.0, 1.0)
        regions["far"] = {"material": "m", "boundary": [f"f{k}" for k in range(4)]}
        boundary["f0"] = {"ux": 0.0, "uy": 0.0}
    for table in curves.values():
        table["points"] = [[-x if mirrored else x, y] for x, y in table["points"]]
    return {"materials": {"m": {"young": 1e3, "poisson": 0.3, "expansion": 1e-5}}, "curves": curves,
            "regions": regions, "boundary": boundary, "temperature": {"hot": 100.0},
            "analysis": {"steps": 1, "order": 1, "scheme": "THST"}}  # fmt: skip


@pytest.mark.parametrize(("far", "mirrored"), [(100.0, False), (1e4, False), (0.0, True)])
def test_energies_of_swelling_do_not_depend_on_where_the_model_ends(
    far: float, mirrored: bool, tmp_path: Path
) -> None:
    """The elastic energy was 9 and 800 times as much with a block far away, and 0.5 % off in the mirror: what swelling
    moves a body by was counted from the corner of the model, and worked on the forces that are out of balance."""
    energies = [pbem.run(heat_block(*each), tmp_path / "blocks.h5", force=True).energy
                for each in ((0.0, False), (far, mirrored))]
    for kind in ("elastic", "external"):
        one, other = (getattr(each, kind)[-1] for each in energies)
        assert other == pytest.approx(one, rel=1e-6)
