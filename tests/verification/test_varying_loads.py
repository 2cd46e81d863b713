"""Loads and strengths that vary along a curve, against exact solutions, in every scheme and by both operators."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pbem
from pbem.results.reader import Results

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
        boundary={f"{name}_{part}": {"tx": {"expression": f"{np.sign(at)!r}*{stress}"}}
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
    results = pbem.run(case | {"interfaces": {"interface": {"law": "coulomb", "friction": expression}}}, tmp_path / "results.h5")
    contact = results.contact["interface"]
    slips = contact.mode[-1] == 1
    assert slips.sum() > 5
    bound = -(0.2 + 0.3 * contact.arc_length**2) * contact.traction_n[-1]
    np.testing.assert_allclose(np.abs(contact.traction_s[-1])[slips], bound[slips], rtol=1e-8)
    assert (np.abs(contact.traction_s[-1]) <= bound * (1 + 1e-8) + 1e-9).all()
