"""Open cracks: stress-intensity factors and openings against closed-form and handbook values."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from pbem.exact import (
    arc_crack_intensity,
    collinear_cracks_intensity,
    crack_opening,
    griffith_field,
    inclined_crack_intensity,
)
from tests.verification.proofs.proof import Outcome, Proof, Solved, Table, largest_error, line, solve_case

ROCK = {"young": 1e3, "poisson": 0.2}
PLANE_MODULUS = 1e3 / (1 - 0.2**2)


def solve_plane(cracks: Table, remote: Table, law: Table | None = None, order: int = 2) -> Solved:
    """Cracks (curves by name) in an infinite plane, all with the same law."""
    return solve_case(
        materials={"rock": ROCK},
        curves=cracks,
        regions={"plane": {"material": "rock", "infinite": True, "cracks": list(cracks)}},
        interfaces={name: law or {"law": "frictionless"} for name in cracks},
        remote=remote,
        analysis={"order": order, "steps": 1},
    )


def solve_griffith(loading: str, order: int, elements: int) -> Solved:
    """A crack of half-length 1.3 under a tension of 2 or a fluid pressure of 2."""
    cracks = {"crack": line(-1.3, 1.3, elements)}
    if loading == "pressure":
        return solve_plane(cracks, {}, {"law": "frictionless", "pressure": 2.0}, order)
    return solve_plane(cracks, {"syy": 2.0}, order=order)


def griffith_factor(loading: str, order: int, elements: int) -> Outcome:
    """Error of KI, at both tips."""
    solved = solve_griffith(loading, order, elements)
    return Outcome(largest_error(solved.factors("crack")[0], 2 * math.sqrt(1.3 * math.pi)), solved.unknowns)


def griffith_opening(loading: str, order: int, elements: int) -> Outcome:
    """Largest error of the opening, relative to the largest opening."""
    solved = solve_griffith(loading, order, elements)
    exact = crack_opening(PLANE_MODULUS, 1.3, 2.0, solved.mesh.pairs.position.real)
    middle = float(crack_opening(PLANE_MODULUS, 1.3, 2.0, 0.0))
    return Outcome(largest_error(solved.last.contact.opening, exact, middle), solved.unknowns)


def griffith_stress() -> Outcome:
    """Stress inside, from a hundredth of the half-length off the tip on; relative to the largest there."""
    solved = solve_griffith("tension", 2, 8)
    reach = 1.3 * np.array([0.01, 0.03, 0.1, 0.3, 1.0, 10.0])
    points = 1.3 + (reach[:, None] * np.exp(1j * np.linspace(-0.8, 0.8, 6) * np.pi)).ravel()
    kappa, shear_modulus = 3 - 4 * ROCK["poisson"], ROCK["young"] / (2 + 2 * ROCK["poisson"])
    exact = griffith_field(kappa, shear_modulus, 1.3, 2.0).stress(points).T
    scale = np.abs(exact).max(axis=1)[:, None]
    return Outcome(float((np.abs(solved.interior(points).stress - exact) / scale).max()), solved.unknowns)


def inclined_crack(degrees: float) -> Outcome:
    """Larger error of KI and KII of a crack at an angle to the tension along y."""
    along = complex(np.exp(1j * math.radians(90 - degrees)))
    solved = solve_plane({"crack": line(-along, along, 8)}, {"syy": 1.0})
    exact = inclined_crack_intensity(1.0, 1.0, math.radians(degrees))
    KI, KII = solved.factors("crack")
    return Outcome(max(largest_error(KI, exact.KI), largest_error(KII, exact.KII)), solved.unknowns)


def collinear_cracks(tips: str) -> Outcome:
    """Error of KI at the inner or the outer tips of two cracks from 0.05 to 1 on either side of the middle."""
    inner, outer = 0.05, 1.0
    solved = solve_plane({"left": line(-outer, -inner, 16), "right": line(inner, outer, 16)}, {"syy": 1.0})
    exact = dict(zip(("inner", "outer"), collinear_cracks_intensity(inner, outer, 1.0), strict=True))[tips]
    at_left, at_right = (1, 0) if tips == "inner" else (0, 1)
    found = solved.factors("left")[0][at_left], solved.factors("right")[0][at_right]
    return Outcome(largest_error(found, exact), solved.unknowns)


def arc_crack(degrees: float, elements: int) -> Outcome:
    """Larger error of KI and |KII| of a crack along an arc, from -degrees to degrees, under equal biaxial tension."""
    arc = {"center": [0, 0], "radius": 1.5, "angles": [-degrees, degrees], "elements": elements}
    solved = solve_plane({"crack": arc}, {"sxx": 1.0, "syy": 1.0})
    exact = arc_crack_intensity(1.5, math.radians(degrees), 1.0)
    KI, KII = solved.factors("crack")
    return Outcome(max(largest_error(KI, exact.KI), largest_error(np.abs(KII), exact.KII)), solved.unknowns)


def row_of_cracks() -> Outcome:
    """Middle one of 21 and of 41 collinear cracks, extrapolated to infinitely many: what is left falls as 1/number."""
    half, pitch = 0.5, 1.0
    found, solved = [], None
    for count in (21, 41):
        places = 2 * pitch * (np.arange(count) - count // 2)
        cracks = {f"crack{k}": line(x - half, x + half, 4) for k, x in enumerate(places)}
        solved = solve_plane(cracks, {"syy": 1.0})
        found.append(solved.factors(f"crack{count // 2}")[0])
    limit = found[1] + (found[1] - found[0]) * 21 / (41 - 21)
    assert solved is not None
    return Outcome(largest_error(limit, periodic_intensity(half, pitch)), solved.unknowns)


def periodic_intensity(half_length: float, half_pitch: float) -> float:
    """KI of an infinite row of collinear cracks under unit tension (Westergaard)."""
    return math.sqrt(2 * half_pitch * math.tan(math.pi * half_length / (2 * half_pitch)))


def solve_plate(
    width: float, height: float, crack: tuple[float, float], sides: Table, elements: int, power: float = 2.0
) -> Solved:
    """A plate from x = 0 under unit tension at y = +-height/2, with a crack on y = 0.

    sides: their condition; power: how much the boundary is refined towards corners and the middles of the sides.
    """
    corners = [complex(x, y) for x, y in ((0, -1), (1, -1), (1, 0), (1, 1), (0, 1), (0, 0))]
    points = [complex(width * z.real, 0.5 * height * z.imag) for z in corners]
    names = ("bottom", "right_lower", "right_upper", "top", "left_upper", "left_lower")
    curves = {name: line(points[k], points[(k + 1) % 6], 16, "both", power) for k, name in enumerate(names)}
    curves["crack"] = line(crack[0], crack[1], elements)
    loads: dict[str, Table] = {name: sides for name in names if "left" in name or "right" in name}
    loads = {name: table for name, table in loads.items() if table}
    return solve_case(
        materials={"rock": ROCK},
        curves=curves,
        regions={"plate": {"material": "rock", "boundary": list(names), "cracks": ["crack"]}},
        boundary=loads | {"top": {"ty": 1.0}, "bottom": {"ty": -1.0}},
        analysis={"steps": 1},
    )


def mirrored_crack() -> Outcome:
    """A crack between two smooth walls, which are mirrors: one of an infinite row."""
    solved = solve_plate(2.0, 8.0, (0.5, 1.5), {"ux": 0.0}, 8)
    return Outcome(largest_error(solved.factors("crack")[0], periodic_intensity(0.5, 1.0)), solved.unknowns)


def edge_crack() -> Outcome:
    """A crack of length 1 in the side of a plate of 100 x 200."""
    solved = solve_plate(100.0, 200.0, (0.0, 1.0), {}, 12, power=4.0)
    return Outcome(largest_error(solved.factors("crack")[0][1], 1.1215 * math.sqrt(math.pi)), solved.unknowns)


def centre_crack(ratio: float) -> Outcome:
    """A crack of length 2 in the middle of a plate of width 2/ratio, three times as high as wide."""
    width = 2 / ratio
    solved = solve_plate(width, 3 * width, (0.5 * width - 1, 0.5 * width + 1), {}, 10)
    factor = (1 - 0.025 * ratio**2 + 0.06 * ratio**4) * math.sqrt(1 / math.cos(0.5 * math.pi * ratio))
    return Outcome(largest_error(solved.factors("crack")[0], factor * math.sqrt(math.pi)), solved.unknowns)


# Factors of a short kink at the angle m pi: rows KI, KII of the kink; columns KI, KII of the crack. By powers of m;
# Amestoy and Leblond, International Journal of Solids and Structures 29 (1992), the terms up to the 20th power.
PI2 = math.pi**2
KINK = {
    (0, 0): {0: 1, 2: -3 * PI2 / 8, 4: PI2 - 5 * PI2**2 / 128,
             6: PI2 / 9 - 11 * PI2**2 / 72 + 119 * PI2**3 / 15360, 8: 5.07790, 10: -2.88312, 12: -0.0925,
             14: 2.996, 16: -4.059, 18: 1.63, 20: 4.1},
    (0, 1): {1: -1.5 * math.pi, 3: math.pi * (10 / 3 + PI2 / 16),
             5: math.pi * (-2 - 133 * PI2 / 180 + 59 * PI2**2 / 1280),
             7: 12.313906, 9: -7.32433, 11: 1.5793, 13: 4.0216, 15: -6.915, 17: 4.21, 19: 4.56},
    (1, 0): {1: 0.5 * math.pi, 3: -math.pi * (4 / 3 + PI2 / 48),
             5: math.pi * (-2 / 3 + 13 * PI2 / 30 - 59 * PI2**2 / 3840),
             7: -6.176023, 9: 4.44112, 11: -1.5340, 13: -2.0700, 15: 4.684, 17: -3.95, 19: -1.32},
    (1, 1): {0: 1, 2: -(4 + 3 * PI2 / 8), 4: 8 / 3 + 29 * PI2 / 18 - 5 * PI2**2 / 128,
             6: -32 / 15 - 4 * PI2 / 9 - 1159 * PI2**2 / 7200 + 119 * PI2**3 / 15360,
             8: 10.58254, 10: -4.78511, 12: -1.8804, 14: 7.280, 16: -7.591, 18: 0.25, 20: 12.5},
}  # fmt: skip


def kinked_crack(degrees: float) -> Outcome:
    """Error of KI and KII at the tip of a kink a thousandth of the crack's length, relative to the larger of the two.

    The crack's own stress along it (T) is zero, so that the length of the kink matters in the first order only.
    """
    sxy, half, kink = -0.4, 1.0, 2e-3
    tip = half + kink * complex(np.exp(1j * math.radians(degrees)))
    crack = {"points": [-half + 0j, half + 0j, tip], "elements": [24, 8], "power": 5.0}
    solved = solve_plane({"crack": crack}, {"sxx": 1.0, "syy": 1.0, "sxy": sxy})
    root = math.sqrt(math.pi * half)
    given = np.array([root, sxy * root])
    m = degrees / 180
    rows = np.array([[sum(value * m**power for power, value in KINK[i, j].items()) for j in (0, 1)] for i in (0, 1)])
    exact = rows @ given
    found = np.array([factor[1] for factor in solved.factors("crack")])
    return Outcome(largest_error(found, exact, float(np.abs(exact).max())), solved.unknowns)


SNEDDON = "Griffith 1921, Sneddon 1946"
TADA = "Tada, Paris, Irwin"
PROOFS = (
    *(
        Proof(f"{name}, order {order}, {elements} elements: {what}", SNEDDON, tolerance,
              partial(run, loading, order, elements))
        for order, elements, tolerance in ((2, 8, 1e-3), (3, 16, 2e-4))
        for name, loading in (("crack under tension", "tension"), ("crack under pressure", "pressure"))
        for what, run in (("KI", griffith_factor), ("opening", griffith_opening))
    ),
    Proof("crack under tension, order 2, 8 elements: stress inside", "Westergaard 1939", 5e-3, griffith_stress),
    *(Proof(f"inclined crack, {angle:g} degrees: KI, KII", SNEDDON, 1e-3, partial(inclined_crack, angle))
      for angle in (15.0, 30.0, 45.0, 60.0, 75.0, 105.0, 150.0)),
    *(Proof(f"two collinear cracks, 0.05 to 1: K at the {tips} tips", TADA, 5e-3, partial(collinear_cracks, tips))
      for tips in ("inner", "outer")),
    *(Proof(f"crack along an arc, {angle:g} degrees: KI, KII", TADA, 5e-3, partial(arc_crack, angle, elements))
      for angle, elements in ((30.0, 8), (60.0, 12), (90.0, 16), (145.0, 24))),
    Proof("row of collinear cracks: KI", "Westergaard 1939", 1e-3, row_of_cracks),
    Proof("crack between smooth walls: KI", "Westergaard 1939", 1e-3, mirrored_crack),
    Proof("edge crack in a large plate: KI", TADA, 3e-3, edge_crack),
    *(Proof(f"centre crack in a plate, 2a/W = {ratio:g}: KI", TADA, 3e-3, partial(centre_crack, ratio))
      for ratio in (0.2, 0.4, 0.6)),
    *(Proof(f"kinked crack, {angle:g} degrees: KI, KII", "Amestoy, Leblond 1992", 1e-2, partial(kinked_crack, angle))
      for angle in (15.0, 30.0, 45.0, 60.0, 75.0)),
)  # fmt: skip
