"""Stress far away that grows with the coordinates, as at rest under gravity: around a circular tunnel, exactly."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pbem
from pbem.arrays import Complex, Real

pytestmark = pytest.mark.usefixtures("without_errors")

YOUNG, POISSON, DENSITY, K0 = 3e3, 0.2, 2.0, 0.5


def expand_around_hole(at_rest: Any, radius: float, center: complex) -> Any:
    """Kolosov's potentials (phi', psi', phi'') that take the tractions of a linear stress off a circle.

    phi = A ln z + sum a_k z^-k, psi = -kappa conj(A) ln z + sum b_k z^-k, with 2 pi (1 + kappa) A = the force that
    carries what was dug out; the coefficients by least squares, with a residual that has to vanish.
    """
    kappa = 3 - 4 * POISSON
    angle = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    e = np.exp(1j * angle)
    xx, yy, xy = at_rest(center + radius * e).T
    into = -e  # outward of the ground
    rest = xx * into.real + xy * into.imag + 1j * (xy * into.real + yy * into.imag)
    force = -(rest.mean() * 2 * np.pi * radius)  # of the elastic field on the ground
    A = -force / (2 * np.pi * (1 + kappa))

    def fields(parts: Real, z: Complex, of_force: complex) -> tuple[Complex, Complex, Complex]:
        a, b = parts[:5] + 1j * parts[5:10], parts[10:15] + 1j * parts[15:]
        k = np.arange(1, 6)
        powers = z[:, None] ** (-k - 1.0)
        slope = of_force / z - powers @ (k * a)
        other = -kappa * np.conj(of_force) / z - powers @ (k * b)
        bend = -of_force / z**2 + (powers / z[:, None]) @ (k * (k + 1) * a)
        return slope, other, bend

    def traction(parts: Real, of_force: complex) -> Complex:
        slope, other, bend = fields(parts, e, of_force)
        return 2 * slope.real * into - np.conj((np.conj(e) * bend + other) * into)

    unit = np.eye(20)
    columns = np.array([traction(each, 0j) for each in unit]).T
    wanted = -rest - traction(np.zeros(20), A / radius)
    parts = np.linalg.lstsq(np.r_[columns.real, columns.imag], np.r_[wanted.real, wanted.imag], rcond=None)[0]
    assert np.abs(columns @ parts - wanted).max() < 1e-12 * np.abs(rest).max()

    def stress(points: Complex) -> Real:
        z = (points - center) / radius
        slope, other, bend = fields(parts, z, A / radius)
        total, half = 4 * slope.real, 2 * (np.conj(z) * bend + other)
        elastic = np.stack([0.5 * (total - half.real), 0.5 * (total + half.real), 0.5 * half.imag], -1)
        return np.asarray(elastic + at_rest(points))

    return stress


@pytest.mark.parametrize(("given", "origin", "radius", "scheme", "operator"), [
    ("initial_stress", 0j, 1.0, "SST", "dense"), ("initial_stress", 1e6 - 4e5j, 30.0, "THST", "hierarchical"),
    ("remote", 0j, 1.0, "HST", "hierarchical"), ("remote", 1e6 - 4e5j, 30.0, "DBEM", "dense"),
])
def test_tunnel_in_ground_at_rest(
    given: str, origin: complex, radius: float, scheme: str, operator: str, tmp_path: Path
) -> None:
    """No free surface: weight and K0 stress; the hole leaves the ground with a net force upward, which is told."""
    center = origin + (2 - 5j) * radius
    grows = DENSITY * 9.81 / radius

    def at_rest(points: Complex) -> Real:
        depth = (points - origin).imag
        return np.stack([K0 * grows * depth, grows * depth, 0 * depth], -1)

    text = f"{grows!r}*(y - ({origin.imag!r}))"
    points = center + radius * np.array([1.02j, 1.3, 0.4 - 1.5j, -2 + 1j, -1.1])
    pairs = np.stack([points.real, points.imag], axis=1).tolist()
    stress = {"syy": {"expression": text}, "sxx": {"expression": f"{K0}*{text}"}}
    case = {
        "materials": {"ground": {"young": YOUNG, "poisson": POISSON, "density": DENSITY / radius}},
        "curves": {"tunnel": {"center": [center.real, center.imag], "radius": radius, "elements": 24}},
        "regions": {"ground": {"material": "ground", "infinite": True, "boundary": ["tunnel"]}},
        "gravity": {"gy": -9.81}, "analysis": {"steps": 2, "scheme": scheme}, "output": {"points": pairs},
        "solver": {"operator": operator},
        given: {"ground": stress} if given == "initial_stress" else stress,
    }  # fmt: skip
    results = pbem.run(case, tmp_path / "tunnel.h5")
    exact = expand_around_hole(at_rest, radius, center)(points)
    np.testing.assert_allclose(results.interior.stress[-1], exact, atol=1e-3 * np.abs(exact).max())
    np.testing.assert_allclose(results.evaluate(pairs).stress[-1], exact, atol=1e-3 * np.abs(exact).max())
    on = results.nodes.position @ [1, 1j]
    hoop = expand_around_hole(at_rest, radius, center)(on)[:, :2].sum(axis=1)  # without traction
    assert np.abs(results.hoop_stress[-1] - hoop).max() < 5e-3 * np.abs(hoop).max()
    # The energy is without bounds; forces balance but for what the ground carries.
    assert np.isnan(results.energy.elastic).all() and np.isnan(results.energy.external).all()
    assert results.balance.relative[-1].max() < 1e-3


def test_ground_that_is_not_dug(tmp_path: Path) -> None:
    """A bonded inclusion of the same ground: nothing moves, under remote stress as by its strain alone; with cracks."""
    text = "20*y - 100"
    case = {
        "materials": {"ground": {"young": YOUNG, "poisson": POISSON, "density": 2.0}},
        "curves": {"rim": {"center": [3, 1], "radius": 1.0, "elements": 16},
                   "crack": {"points": [[-1, 0], [0.5, 0.4]], "elements": 8}},
        "regions": {"ground": {"material": "ground", "infinite": True, "boundary": ["rim"], "cracks": ["crack"]},
                    "core": {"material": "ground", "boundary": ["rim"]}},
        "interfaces": {"crack": {"friction": 0.6}},
        "gravity": {"gy": -10.0}, "analysis": {"steps": 2}, "output": {"points": [[3, 1], [3, 2.5], [-4, -2]]},
        "initial_stress": {"ground": {"syy": {"expression": text}, "sxx": {"expression": f"0.8*({text})"}}},
    }  # fmt: skip
    results = pbem.run(case, tmp_path / "rest.h5")
    assert np.abs(results.displacement).max() < 1e-9 * 100 / YOUNG
    depth = 20 * results.interior.position[:, 1] - 100
    np.testing.assert_allclose(results.interior.stress[-1], np.stack([0.8 * depth, depth, 0 * depth], -1), atol=1e-7)


@pytest.mark.parametrize(("gravity", "remote", "words"), [
    (-10.0, {"syy": -1.0}, "which no stress carries"),
    (0.0, {"syy": {"expression": "20*y"}}, "grows by (0, 20) per length"),
    (-10.0, {"syy": {"expression": "20*y*y"}}, "not linear"),
    (-10.0, {"syy": {"expression": "20*z"}}, "z"),
])
def test_stress_far_away_out_of_balance(gravity: float, remote: dict[str, Any], words: str) -> None:
    case = {
        "materials": {"ground": {"young": YOUNG, "poisson": POISSON, "density": 2.0}},
        "curves": {"tunnel": {"center": [0, 0], "radius": 1.0, "elements": 16}},
        "regions": {"ground": {"material": "ground", "infinite": True, "boundary": ["tunnel"]}},
        "gravity": {"gy": gravity}, "remote": remote,
    }  # fmt: skip
    with pytest.raises(pbem.CaseError) as caught:
        pbem.run(case, "none.h5")
    assert words in str(caught.value)


@pytest.mark.parametrize("at_rest", [False, True])
def test_slopes_that_balance_each_other_but_for_rounding(tmp_path: Path, at_rest: bool) -> None:
    """Stress far away that bends a plane without weight; a bonded core of the same ground does not disturb it.

    With factors like 0.3 the slopes cancel but for the last digit, which was measured against a weight of zero.
    """
    stress = {"sxx": "-5 + 0.3*x + 0.2*y", "sxy": "0.4 - 0.1*x - 0.3*y", "syy": "0.25*x + 0.1*y - 6"}
    case = {
        "materials": {"ground": {"young": YOUNG, "poisson": POISSON}},
        "curves": {"rim": {"center": [0.5, 0.3], "radius": 1.0, "elements": 12}},
        "regions": {"ground": {"material": "ground", "infinite": True, "boundary": ["rim"]},
                    "core": {"material": "ground", "boundary": ["rim"]}},
        "analysis": {"steps": 1}, "output": {"points": [[0.5, 0.3], [2, 2], [6, -3]]},
    }  # fmt: skip
    given = {key: {"expression": text} for key, text in stress.items()}
    case |= {"initial_stress": {"ground": given}} if at_rest else {"remote": given}
    results = pbem.run(case, tmp_path / "bent.h5")
    x, y = results.interior.position.T
    exact = np.stack([-5 + 0.3 * x + 0.2 * y, 0.25 * x + 0.1 * y - 6, 0.4 - 0.1 * x - 0.3 * y], -1)
    np.testing.assert_allclose(results.interior.stress[-1], exact, atol=6 * 1e-4)
