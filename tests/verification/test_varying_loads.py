"""Loads and strengths that vary along a curve, against exact solutions, in every scheme and by both operators."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pbem
from pbem.results.reader import Results

pytestmark = pytest.mark.usefixtures("without_errors")

YOUNG, POISSON = 200.0, 0.3
# Of the injection: half-length a of what slips over sqrt(4 alpha t), and slip in its middle delta E'/(f dp a), by
# T = (f sigma' - tau)/(f dp) (Viesca, J. Fluid Mech. 928, A29, 2021).
INJECTED = {0.5: (0.791607, 0.934648), 0.9: (0.139813, 0.199566), 0.1: (3.640516, 0.889433)}


def make_bent_beam(scheme: str, order: int, operator: str, origin: complex, unit: float) -> pbem.Case:
    """Two layers, bonded, free in the plane, under tractions of sxx = -c (y - y0), all other stresses zero."""
    x, y = origin.real, origin.imag
    stress = f"(y - {y!r})*{-3.0 / unit!r}"

    def line(a: complex, b: complex, elements: int) -> dict[str, object]:
        points = [[origin.real + unit * p.real, origin.imag + unit * p.imag] for p in (a, b)]
        return {"points": points, "elements": elements, "grading": "none"}

    ends = ((-1, -0.5, "left"), (1, 0.5, "right"))
    return pbem.Case(
        materials={"m": {"young": YOUNG, "poisson": POISSON}},
        curves={
            "low": line(-1 - 0.5j, 1 - 0.5j, 4), "joint": line(-1 + 0j, 1 + 0j, 5),
            "high": line(1 + 0.5j, -1 + 0.5j, 4),
            **{f"{name}_{part}": line(complex(at, 0), complex(at, to), 3)
               for at, _, name in ends for part, to in (("below", -0.5), ("above", 0.5))},
        },
        regions={
            "below": {"material": "m", "boundary": ["low", "right_below", "joint", "left_below"]},
            "above": {"material": "m", "boundary": ["high", "right_above", "joint", "left_above"]},
        },
        boundary={f"{name}_{part}": {"tx": {"expression": f"{int(np.sign(at))}*{stress}"}}
                  for at, _, name in ends for part in ("below", "above")},
        analysis={"scheme": scheme, "order": order, "steps": 1},
        solver={"operator": operator},
        output={"points": [[x + 0.3 * unit, y + 0.2 * unit], [x - 0.6 * unit, y - 0.31 * unit]]},
    )


@pytest.mark.parametrize("operator", ["dense", "hierarchical"])
@pytest.mark.parametrize("scheme", ["SST", "DBEM", "HST", "THST"])
@pytest.mark.parametrize(("order", "origin", "unit"), [(2, 0j, 1.0), (3, 700.0 - 300.0j, 1e-3)])
def test_bending_by_tractions_that_vary_is_exact(
    scheme: str, order: int, origin: complex, unit: float, operator: str, tmp_path: Path
) -> None:
    """The displacement is quadratic, which the shapes contain; the body is held by nothing, as its loads balance."""
    results = pbem.run(make_bent_beam(scheme, order, operator, origin, unit), tmp_path / "results.h5")
    stress = results.interior.stress[-1]
    y = results.interior.position[:, 1] - origin.imag
    exact = np.column_stack([-3.0 / unit * y, 0 * y, 0 * y])
    np.testing.assert_allclose(stress, exact, atol=2e-6 if operator == "hierarchical" else 1e-8)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_the_resultant_of_water_on_a_wall_is_exact(order: int, tmp_path: Path) -> None:
    """Pressure rho g (h - y) on a wall that leans by a fourth: forces h^2/2 and h^2/8, whatever holds the dam."""
    depth, weight, lean = 12.0, 9.81e3, 0.25
    foot, crest = [0.0, 100.0], [lean * depth, 100.0 + depth]
    case = pbem.Case(
        materials={"concrete": {"young": 2e10, "poisson": 0.2}},
        curves={"base": {"points": [foot, [10.0, 100.0]], "elements": 6},
                "back": {"points": [[10.0, 100.0], [6.0, 112.0], crest], "elements": 8},
                "wall": {"points": [foot, crest], "elements": 7}},
        regions={"dam": {"material": "concrete", "boundary": ["base", "back", "wall"]}},
        boundary={"base": {"ux": 0.0, "uy": 0.0},
                  "wall": {"pressure": {"expression": f"{weight!r}*({100 + depth!r} - y)"}}},
        analysis={"order": order, "steps": 1},
    )  # fmt: skip
    force = pbem.run(case, tmp_path / "results.h5").reactions["wall"][-1]
    exact = 0.5 * weight * depth**2
    assert force == pytest.approx([exact, -lean * exact], rel=1e-12)


def find_injection(T: float, elements: int, folder: Path) -> tuple[float, float, Results]:
    """Half-length of the slipping part and slip in its middle, over the exact ones, of a = 1 at the end."""
    length, friction, rise, young = 2.0, 0.6, 0.3, 1000.0
    spread = 1 / INJECTED[T][0]
    pressure = f"{rise}*erfc(abs(s - {length})/({spread!r}*sqrt(t)))"
    case = pbem.Case(
        materials={"rock": {"young": young, "poisson": 0.25}},
        curves={"fault": {"points": [[-length, 0], [length, 0]], "elements": elements, "grading": "none"}},
        regions={"plane": {"material": "rock", "cracks": ["fault"], "infinite": True}},
        interfaces={"fault": {"friction": friction, "pressurised": "all"}},
        stages=[
            {"name": "rest", "steps": 1, "duration": 1e-6,
             "remote": {"syy": -1.0, "sxy": friction - T * friction * rise}},
            {"name": "inject", "steps": 4, "duration": 1.0,
             "interfaces": {"fault": {"pressure": {"expression": pressure}}}},
        ],
    )  # fmt: skip
    results = pbem.run(case, folder / "results.h5")
    contact = results.contact["fault"]
    x, slip = contact.arc_length - length, np.abs(contact.slip[-1])
    # Near its end the slip falls with the power 3/2 of the distance to it.
    near = (x > 0.6) & (x < 0.95)
    end = np.roots(np.polyfit(x[near], slip[near] ** (2 / 3), 2)).real
    middle = np.interp(0.0, x, slip) * young / (1 - 0.25**2) / (friction * rise)
    return float(end[np.argmin(np.abs(end - 1))]), float(middle / INJECTED[T][1]), results


@pytest.mark.parametrize("T", INJECTED)
def test_slip_by_injection_follows_the_exact_solution(T: float, tmp_path: Path) -> None:
    """A fault near failure is slipped by the pressure that spreads from its middle."""
    half_length, middle, results = find_injection(T, 120, tmp_path)
    assert half_length == pytest.approx(1.0, abs=5e-3)
    assert middle == pytest.approx(1.0, abs=5e-4)
    assert results.contact["fault"].opening[-1].max() == 0.0


def test_friction_that_varies_bounds_every_pair(tmp_path: Path) -> None:
    """A block drawn over a plate whose friction rises along it: pairs that slip carry their own bound."""
    expression = {"expression": "0.2 + 0.3*s**2"}
    case = dict(pbem.Case.read("cases/two_blocks_sliding.toml").given)
    law = {"interface": {"law": "coulomb", "friction": expression}}
    results = pbem.run(case | {"interfaces": law}, tmp_path / "results.h5")
    contact = results.contact["interface"]
    slips = contact.mode[-1] == 1
    assert slips.sum() > 5
    bound = -(0.2 + 0.3 * contact.arc_length**2) * contact.traction_n[-1]
    np.testing.assert_allclose(np.abs(contact.traction_s[-1])[slips], bound[slips], rtol=1e-8)
    assert (np.abs(contact.traction_s[-1]) <= bound * (1 + 1e-8) + 1e-9).all()


def make_ground(origin: complex, unit: float, wall: str) -> dict[str, Any]:
    """A box of soil on rollers, its surface free, with a fault across it, at rest under its own weight."""
    x, y, density, gravity = origin.real, origin.imag, 2e-6, -9810.0
    weight = f"({density * gravity!r})*({y + 10 * unit!r} - y)"

    def line(*points: tuple[float, float]) -> dict[str, object]:
        return {"points": [[x + unit * a, y + unit * b] for a, b in points], "elements": 6}

    return {
        "materials": {"soil": {"young": 50.0, "poisson": 0.3, "density": density}},
        "curves": {"bottom": line((0, 0), (20, 0)), "right": line((20, 0), (20, 10)), "top": line((20, 10), (0, 10)),
                   "left": line((0, 0), (0, 10)), "fault": line((6, 3), (14, 8))},
        "regions": {"a": {"material": "soil", "boundary": ["bottom", "right", "top", "left"], "cracks": ["fault"]}},
        "boundary": {"bottom": {"uy": 0.0}, "left": {"ux": 0.0}, "right": {wall: 0.0}},
        "interfaces": {"fault": {"friction": 0.7}},
        "gravity": {"gy": gravity},
        "initial_stress": {"soil": {"sxx": {"expression": f"0.6*{weight}"}, "syy": {"expression": weight}}},
        "output": {"points": [[x + 5 * unit, y + 4 * unit]]},
        "analysis": {"steps": 2},
    }


@pytest.mark.parametrize(("origin", "unit"), [(0j, 1.0), (4.5e5 + 7.1e6j, 1e3)])
def test_ground_at_rest_does_not_move(origin: complex, unit: float, tmp_path: Path) -> None:
    """The stress at rest is that given; without it the ground settles under its weight, by rho g h^2/(2 E_oed)."""
    tables = make_ground(origin, unit, "ux")
    results = pbem.run(tables, tmp_path / "rest.h5")
    settled = pbem.run({key: table for key, table in tables.items() if key != "initial_stress"}, tmp_path / "free.h5")
    largest = np.abs(settled.displacement[-1]).max()
    oedometric = 50.0 * (1 - 0.3) / ((1 + 0.3) * (1 - 2 * 0.3))
    assert largest == pytest.approx(2e-6 * 9810 * (10 * unit) ** 2 / (2 * oedometric), rel=1e-6)
    assert np.abs(results.displacement).max() < 1e-9 * largest
    vertical = -2e-6 * 9810 * 6 * unit
    np.testing.assert_allclose(results.interior.stress[-1][0], [0.6 * vertical, vertical, 0.0],
                               atol=1e-8 * abs(vertical))
    assert (results.contact["fault"].mode[-1] == 0).all()
    after = results.evaluate(results.interior.position)
    np.testing.assert_allclose(after.stress, results.interior.stress, atol=1e-8 * abs(vertical))


def test_ground_that_loses_its_wall_has_the_energy_of_its_field(tmp_path: Path) -> None:
    """The integral of (s0 + s)/2 : strain is half that of (s - s0) : strain, as when tractions -s0 n pull at the same
    body without weight, and that of s0 : strain, the work of t0 on the boundary and of the weight inside."""
    tables = make_ground(0j, 1.0, "tx")
    tables["regions"] = {"a": {"material": "soil", "boundary": ["bottom", "right", "top", "left"]}}
    tables["curves"] = {name: curve for name, curve in tables["curves"].items() if name != "fault"}
    del tables["interfaces"]
    points, weights = np.polynomial.legendre.leggauss(10)
    grid = [[10 + 10 * a, 5 + 5 * b] for a in points for b in points]
    results = pbem.run(tables | {"output": {"points": grid}}, tmp_path / "open.h5")
    assert results.reactions["bottom"][-1] == pytest.approx([0.0, 2e-6 * 9810 * 200], rel=1e-5, abs=1e-9)
    pulled = tables | {"boundary": {"bottom": {"uy": 0.0}, "left": {"ux": 0.0},
                                    "right": {"tx": {"expression": f"0.6*{2e-6 * 9810}*(10 - y)"}}}}
    alike = pbem.run({key: table for key, table in pulled.items() if key not in ("initial_stress", "gravity")},
                     tmp_path / "pulled.h5")
    np.testing.assert_allclose(results.displacement[-1], alike.displacement[-1], atol=1e-9)
    weight, outward = np.outer(weights, weights).ravel() * 50, 2 * alike.energy.external[-1]
    inside = -2e-6 * 9810 * float(weight @ results.interior.displacement[-1][:, 1])
    assert results.energy.elastic[-1] == pytest.approx(0.5 * outward - outward + inside, rel=2e-3)
    assert results.energy.external[-1] == pytest.approx(results.energy.elastic[-1], rel=1e-6)


def test_stress_at_rest_that_does_not_fit_is_told() -> None:
    for change, text in (
        ({"sxx": {"expression": "x*y"}}, "not linear"),
        ({"syy": {"expression": "1e-3*y"}}, "in balance with the weight"),
        ({"syy": {"expression": "s"}}, "unknown name 's'"),
    ):
        with pytest.raises(pbem.CaseError, match=text):
            pbem.run(make_ground(0j, 1.0, "ux") | {"initial_stress": {"soil": change}})
