"""Meshes that the program fits to near faces: thin bodies, ligaments, parallel cracks, slots and wedges.

Reference solutions: beam theory in plane strain with Timoshenko's shear, Jeffery's eccentric ring (S. Timoshenko and
J. Goodier, Theory of Elasticity, art. 73), collinear cracks and cracks along arcs (H. Tada, P. Paris and G. Irwin), the
crack that a slot tends to, and the same model on a much finer mesh.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pbem.contact.laws import OPEN
from pbem.exact import arc_crack_intensity, collinear_cracks_intensity
from tests.verification.proofs.proof import Solved, line, solve_case

ROCK = {"young": 1000.0, "poisson": 0.2}
MODULUS = 1000.0 / (1 - 0.2**2)


def solve_cantilever(slenderness: float, scale: float = 1.0) -> float:
    """Deflection of the end over that of a clamped beam in plane strain, with 10 elements asked along each side."""
    length, thick = 10.0 * scale, 10.0 * scale / slenderness
    corners = [0j, complex(length, 0), complex(length, thick), complex(0, thick)]
    bottom, right, top, left = (line(corners[k], corners[(k + 1) % 4], 10 if k % 2 == 0 else 3) for k in range(4))
    solved = solve_case(
        materials={"rock": ROCK},
        curves={"bottom": bottom, "right": right, "top": top, "left": left},
        regions={"beam": {"material": "rock", "boundary": ["bottom", "right", "top", "left"]}},
        boundary={"left": {"ux": 0.0, "uy": 0.0}, "right": {"tx": 0.0, "ty": -1e-3}},
        analysis={"steps": 1},
    )
    end = np.argmax(solved.mesh.position.real)
    force = 1e-3 * thick
    bending = 4 * force * length**3 / (MODULUS * thick**3)
    shear = 1.2 * force * length / (thick * 1000.0 / (2 * 1.2))
    return float(-solved.last.displacement[end].imag / (bending + shear))


@pytest.mark.parametrize("slenderness", [10, 30, 100, 200])
def test_the_deflection_of_cantilevers(slenderness: float) -> None:
    assert solve_cantilever(slenderness) == pytest.approx(1.0, abs=0.015)


def test_the_deflection_does_not_depend_on_the_unit_of_length() -> None:
    assert solve_cantilever(60.0, 1e-6) == pytest.approx(solve_cantilever(60.0), rel=1e-7)


@pytest.mark.parametrize(("ligament", "order"), [(0.1, 3), (0.05, 2), (0.03, 3), (0.03, 2), (0.01, 2), (0.003, 3)])
def test_the_stress_in_the_ligament_of_an_eccentric_ring(ligament: float, order: int) -> None:
    assert compare_hoop_stress(ligament, order, 2.0, "SST") == pytest.approx(1.0, rel=0.005)


@pytest.mark.parametrize(
    ("ligament", "radius", "order", "allowed"),
    [(0.02, 2.7, 1, 0.07), (0.08, 2.0, 2, 0.005), (0.004, 3.3, 2, 0.005), (0.007, 1.4, 3, 1e-3)],
)
def test_the_ligament_bends_where_the_scheme_has_traction_equations(
    ligament: float, radius: float, order: int, allowed: float
) -> None:
    # With traction equations on the outer face 58 and 0.979, 0.388 and 0.998 times the stress.
    assert compare_hoop_stress(ligament, order, radius, "THST") == pytest.approx(1.0, rel=allowed)


def compare_hoop_stress(ligament: float, order: int, radius: float, scheme: str) -> float:
    """Largest hoop stress of an eccentric ring with a bore of radius 1 under pressure, over that of Jeffery."""
    e = radius - 1 - ligament
    solved = solve_case(
        materials={"rock": {"young": 1000.0, "poisson": 0.3}},
        curves={
            "inner": {"center": [e, 0.0], "radius": 1.0, "elements": 64},
            "outer": {"center": [0.0, 0.0], "radius": radius, "elements": 64},
        },
        regions={"ring": {"material": "rock", "boundary": ["inner", "outer"]}},
        boundary={"inner": {"pressure": 1.0}},
        analysis={"steps": 1, "order": order, "scheme": scheme},
    )
    thinnest = np.argmin(np.abs(solved.mesh.position - (1 + e)))
    squares = radius**2 + 1
    exact = 2 * radius**2 * (squares - 2 * e - e**2) / (squares * (radius**2 - 1 - 2 * e - e**2)) - 1
    return float(solved.hoop_stress()[thinnest] / exact)


def solve_parallel_cracks(distance: float, elements: int, remote: dict[str, float]) -> tuple[np.ndarray, np.ndarray]:
    solved = solve_case(
        materials={"rock": ROCK},
        curves={"low": line(-0.5, 0.5, elements), "high": line(-0.5 + distance * 1j, 0.5 + distance * 1j, elements)},
        regions={"plane": {"material": "rock", "infinite": True, "cracks": ["low", "high"]}},
        remote=remote,
        analysis={"steps": 1},
    )
    return solved.factors("low")


@pytest.mark.parametrize("distance", [0.5, 0.1, 0.03])
@pytest.mark.parametrize("remote", [{"syy": 1.0}, {"syy": -1.0, "sxy": 1.0}], ids=["tension", "closed"])
def test_the_factors_of_parallel_cracks(distance: float, remote: dict[str, float]) -> None:
    coarse, fine = (np.array(solve_parallel_cracks(distance, count, remote)) for count in (8, 120))
    assert np.abs(coarse - fine).max() < 0.01 * np.abs(fine).max()


@pytest.mark.parametrize(("distance", "operator"), [(0.0028, "dense"), (0.0055, "hierarchical")])
def test_the_strip_between_parallel_cracks_touches_where_it_bends(distance: float, operator: str) -> None:
    """In a twentieth of its length: the search lifts it elsewhere, and not pair by pair."""
    cracks = {"low": line(-0.5 + 0j, 0.5 + 0j, 8), "high": line(-0.5 + 1j * distance, 0.5 + 1j * distance, 8)}
    solved = solve_case(
        materials={"rock": ROCK}, curves=cracks, remote={"sxx": 0.3, "syy": 1.0, "sxy": -0.4},
        interfaces={name: {"law": "frictionless"} for name in cracks},
        regions={"plane": {"material": "rock", "infinite": True, "cracks": list(cracks)}},
        analysis={"steps": 1}, solver={"operator": operator, "newton_max_iterations": 20, "min_step": 1.0},
    )
    touching = np.mean(solved.last.contact.mode != OPEN)
    assert 0.02 < touching < 0.1
    # From far away the two are one open crack: what both release at an end is what that one would.
    released = sum(np.square(solved.factors(name)).sum(axis=0) for name in cracks)
    np.testing.assert_allclose(released, np.pi / 2 * (1.0 + 0.4**2), rtol=0.01)


def solve_cracks(cracks: dict[str, Any], law: dict[str, Any], remote: dict[str, float], order: int = 2) -> Solved:
    """Cracks in an infinite plane."""
    return solve_case(
        materials={"rock": ROCK}, curves=cracks, remote=remote, interfaces={name: law for name in cracks},
        regions={"plane": {"material": "rock", "infinite": True, "cracks": list(cracks)}},
        analysis={"steps": 1, "order": order},
    )


@pytest.mark.parametrize("order", [1, 2, 3])
@pytest.mark.parametrize("ligament", [3e-2, 1e-3, 1e-4])
def test_the_factors_at_the_ligament_of_collinear_cracks(ligament: float, order: int) -> None:
    inner, outer = ligament / 2, 1 + ligament / 2
    cracks = {"left": line(-outer, -inner, 8), "right": line(inner, outer, 8)}
    KI = solve_cracks(cracks, {"law": "open"}, {"syy": 1.0}, order).factors("right")[0]
    exact = collinear_cracks_intensity(inner, outer, 1.0)
    np.testing.assert_allclose(KI, exact, rtol={1: 1e-2, 2: 2e-3, 3: 2e-4}[order])


def test_the_factors_of_a_crack_along_an_arc_that_is_all_but_closed() -> None:
    arc = {"center": [0.0, 0.0], "radius": 1.0, "angles": [0.0, 359.0], "elements": 40}
    factors = np.abs(solve_cracks({"arc": arc}, {"law": "open", "pressure": 1.0}, {}).factors("arc"))
    exact = arc_crack_intensity(1.0, np.radians(179.5), 1.0)
    np.testing.assert_allclose(factors.T, [exact, exact], atol=3e-3 * max(exact))


@pytest.mark.parametrize("direction", [1j, np.exp(0.6j)])
@pytest.mark.parametrize("distance", [1e-2, 1e-3])
def test_the_factors_of_a_crack_that_all_but_meets_another_one(distance: float, direction: complex) -> None:
    def solve(elements: int, order: int) -> np.ndarray:
        near = 0.1 + distance * 1j
        cracks = {"long": line(-1, 1, elements), "near": line(near, near + direction, elements)}
        solved = solve_cracks(cracks, {"law": "open"}, {"sxx": 0.8, "syy": 0.6, "sxy": 0.2}, order)
        return np.array([solved.factors("long"), solved.factors("near")])

    coarse, fine = solve(8, 2), solve(32, 3)
    error, size = (np.hypot(*np.moveaxis(each, 1, 0)) for each in (coarse - fine, fine))
    assert (error < 0.01 * size).all()


def solve_slot(width: float, scheme: str, counts: tuple[int, int] = (20, 27)) -> Solved:
    """A plate with a slot from its right side to the middle, clamped below, pulled at the top; width 0: a crack."""
    curves: dict[str, Any] = {"bottom": line(-1j, 3 - 1j, 12), "top": line(3 + 1j, 1j, 12), "left": line(1j, -1j, 12)}
    plate: dict[str, Any] = {"material": "rock", "boundary": ["bottom", "right_low", "right_high", "top", "left"]}
    h = 0.5j * width
    curves |= {"right_low": line(3 - 1j, 3 - h, 12), "right_high": line(3 + h, 3 + 1j, 12)}
    if width:
        slot = {"low": line(3 - h, 1 - h, counts[0]), "high": line(3 + h, 1 + h, counts[1])}
        slot["end"] = line(1 - h, 1 + h, 2)
        curves |= slot
        plate["boundary"] += [*slot]
    else:
        curves["low"] = line(3 + 0j, 1 + 0j, max(counts))
        plate["cracks"] = ["low"]
    return solve_case(
        materials={"rock": {"young": 1000.0, "poisson": 0.3}},
        curves=curves,
        regions={"plate": plate},
        boundary={"bottom": {"ux": 0.0, "uy": 0.0}, "top": {"tx": 0.0, "ty": 0.1}},
        analysis={"steps": 1, "scheme": scheme},
    )


def find_lift(solved: Solved) -> float:
    return float(solved.last.displacement[np.argmax(solved.mesh.position.real + solved.mesh.position.imag)].imag)


@pytest.mark.parametrize("scheme", ["SST", "DBEM", "HST"])
def test_a_slot_tends_to_a_crack_however_narrow_it_is(scheme: str) -> None:
    crack = find_lift(solve_slot(0.0, scheme))
    assert find_lift(solve_slot(1e-3, scheme)) == pytest.approx(crack, rel=2e-3)
    assert find_lift(solve_slot(1e-6, scheme)) == pytest.approx(crack, rel=2e-4)


def test_the_faces_of_a_slot_have_the_same_elements() -> None:
    solved = solve_slot(1e-3, "SST")
    low, high = (solved.model.curves[name].legs[0] for name in ("low", "high"))
    assert low.elements == high.elements
    np.testing.assert_allclose(low.element_fractions(), high.element_fractions(), rtol=0, atol=1e-15)


def solve_needle(angle: float, halves: int, **analysis: Any) -> float:
    """Jump at the mouth of an open crack that leaves the side of a plate at a small angle: a slender needle bends."""
    end = -2 - 1j + 1.5 * np.exp(1j * np.radians(90 - angle))
    curves = {
        "bottom": line(-2 - 2j, 2 - 2j, 10), "right": line(2 - 2j, 2 + 2j, 10), "top": line(2 + 2j, -2 + 2j, 10),
        "above": line(-2 + 2j, -2 - 1j, 10), "below": line(-2 - 1j, -2 - 2j, 10),
        "crack": line(-2 - 1j, complex(end), 8 * 2**halves),
    }  # fmt: skip
    solved = solve_case(
        materials={"rock": ROCK},
        curves=curves,
        regions={"plate": {"material": "rock", "boundary": [*curves][:5], "cracks": ["crack"]}},
        interfaces={"crack": {"law": "open"}},
        boundary={"bottom": {"ux": 0.0, "uy": 0.0}, "top": {"ux": 0.01, "uy": 0.01}},
        analysis={"steps": 1, **analysis},
    )
    return float(solved.last.contact.opening[0])


@pytest.mark.parametrize("angle", [6.0, 8.0, 15.0, 25.0, 40.0])
def test_the_needle_at_the_mouth_of_a_shallow_crack(angle: float) -> None:
    assert solve_needle(angle, 0) == pytest.approx(solve_needle(angle, 1, order=3), rel=0.005)


@pytest.mark.parametrize(("angle", "turn"), [(3.0, 0.0), (5.0, 40.0)])
def test_a_sharp_wedge_bends_as_a_beam_that_tapers(angle: float, turn: float) -> None:
    # M = p x^2/2 and I = (a x)^3/12 at the distance x from the edge: the edge moves by 6 p/(E' a^3), and by 1.2 p/(G a)
    # of shear, for a length of 1; the square of the angle is left out.
    slope, pressure, along = np.tan(np.radians(angle)), 1e-6, np.exp(1j * np.radians(turn))
    corners = [0j, along, along * (1 + 1j * slope)]
    curves = {name: line(complex(corners[k]), complex(corners[(k + 1) % 3]), count)
              for k, (name, count) in enumerate({"low": 8, "wall": 4, "high": 8}.items())}
    solved = solve_case(
        materials={"rock": ROCK},
        curves=curves,
        regions={"wedge": {"material": "rock", "boundary": list(curves)}},
        boundary={"wall": {"ux": 0.0, "uy": 0.0}, "high": {"pressure": pressure}},
        analysis={"steps": 1},
    )
    edge = np.argmin(np.abs(solved.mesh.position))
    moved = -(solved.last.displacement[edge] / along).imag
    beam = pressure * (6 / (MODULUS * slope**3) + 1.2 / (1000.0 / 2.4 * slope))
    assert moved == pytest.approx(beam, rel=0.01)
