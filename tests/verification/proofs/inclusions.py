"""Circular holes and inclusions in an infinite plane, and rings in rings."""

from __future__ import annotations

from typing import Any

import numpy as np

from pbem.contact.laws import OPEN
from pbem.exact import kirsch_field
from pbem.model.material import Material
from tests.verification.proofs.proof import Complex, Outcome, Proof, Solved, Table, largest_error, line, solve_case

ROCK = Material("rock", 1e3, 0.2)
GRAIN = Material("grain", 3e3, 0.3)
CIRCLE = {"center": [0, 0], "radius": 1.0, "elements": 48}


def describe_material(material: Material) -> dict[str, float]:
    """A material's table."""
    return {"young": material.young, "poisson": material.poisson}


def solve_inclusion(law: Table, remote: Table) -> Solved:
    """A grain of radius 1 in an infinite plane."""
    return solve_case(
        materials={material.name: describe_material(material) for material in (ROCK, GRAIN)},
        curves={"circle": CIRCLE},
        regions={
            "plane": {"material": "rock", "infinite": True, "boundary": ["circle"]},
            "grain": {"material": "grain", "boundary": ["circle"]},
        },
        interfaces={"circle": law},
        remote=remote,
        analysis={"steps": 1},
    )


def bonded_inclusion() -> Outcome:
    """Tractions all around, which are those of a uniform stress; relative to the remote tension."""
    solved = solve_inclusion({"law": "bonded"}, {"sxx": 1.0})
    ratio = ROCK.shear_modulus / GRAIN.shear_modulus
    mean = (ROCK.kappa + 1) / (2 + ratio * (GRAIN.kappa - 1))
    difference = (ROCK.kappa + 1) / (ratio + ROCK.kappa)
    sxx, syy = 0.5 * (mean + difference), 0.5 * (mean - difference)
    grain = solved.mesh.region_names.index("grain")
    inside = np.flatnonzero(solved.mesh.node_region == grain)
    normal = solved.mesh.normal[inside]
    exact = sxx * normal.real + 1j * syy * normal.imag
    return Outcome(largest_error(solved.last.traction[inside], exact, 1.0), solved.unknowns)


def smooth_inclusion() -> Outcome:
    """Contact pressure all around, relative to the larger remote compression; the grain may turn freely."""
    sxx, syy = -1.0, -1.5
    solved = solve_inclusion({"law": "frictionless"}, {"sxx": sxx, "syy": syy})
    ratio = ROCK.shear_modulus / GRAIN.shear_modulus
    k1, k2 = ROCK.kappa, GRAIN.kappa
    p0 = -(k1 + 1) * (sxx + syy) / (4 + 2 * (k2 - 1) * ratio)
    p2 = -3 * (k1 + 1) * (sxx - syy) / ((3 * k1 + 1) + (k2 + 3) * ratio)
    angle = np.angle(solved.mesh.pairs.position)
    contact = solved.last.contact
    assert not (contact.mode == OPEN).any()
    error = largest_error(contact.traction_n, -(p0 + p2 * np.cos(2 * angle)), 1.5)
    return Outcome(max(error, float(np.abs(contact.traction_s).max())), solved.unknowns)


def solve_hole() -> Solved:
    """A hole of radius 1 in a plane under unit tension along x."""
    return solve_case(
        materials={"rock": describe_material(ROCK)},
        curves={"circle": CIRCLE},
        regions={"plane": {"material": "rock", "infinite": True, "boundary": ["circle"]}},
        remote={"sxx": 1.0},
        analysis={"steps": 1},
    )


def hole_displacement() -> Outcome:
    """Displacements of the hole's wall, relative to the largest."""
    solved = solve_hole()
    exact: Complex = kirsch_field(ROCK.kappa, ROCK.shear_modulus, 1.0, 1.0).displacement(solved.mesh.position)
    return Outcome(largest_error(solved.last.displacement, exact, float(np.abs(exact).max())), solved.unknowns)


def hole_stress() -> Outcome:
    """sxx, syy, sxy inside the plane, from near the wall on, relative to the tension."""
    solved = solve_hole()
    radius = np.array([1.02, 1.1, 1.5, 3.0, 20.0])
    around = np.exp(1j * np.linspace(0.5, 6, 7))[:, None] * radius
    points: Complex = np.append(around.ravel(), 1j * radius)  # sxx(0, y) = S/2 (2 + 1/y^2 + 3/y^4)
    exact = kirsch_field(ROCK.kappa, ROCK.shear_modulus, 1.0, 1.0).stress(points).T
    on_axis = points.real == 0
    y = points.imag[on_axis]
    assert np.allclose(exact[on_axis, 0], 0.5 * (2 + 1 / y**2 + 3 / y**4))
    return Outcome(largest_error(solved.interior(points).stress, exact, 1.0), solved.unknowns)


def hole_hoop_stress() -> Outcome:
    """Hoop stress on the wall, 1 - 2 cos(2 angle), relative to the largest, 3."""
    solved = solve_hole()
    exact = 1 - 2 * np.cos(2 * np.angle(solved.mesh.position))
    return Outcome(largest_error(solved.hoop_stress(), exact, 3.0), solved.unknowns)


INNER, MIDDLE, OUTER = 1.0, 1.5, 2.5


def solve_rings(**loads: Any) -> Solved:
    """A quarter of a ring (rock) in a ring (grain), which touch without friction."""
    radii = {"bore": INNER, "joint": MIDDLE, "rim": OUTER}
    arc = {"center": [0, 0], "angles": [0, 90], "elements": 12, "grading": "none"}  # nothing is singular here
    curves: dict[str, Any] = {name: arc | {"radius": radius} for name, radius in radii.items()}
    for ring, (inner, outer) in {"first": (INNER, MIDDLE), "second": (MIDDLE, OUTER)}.items():
        curves[f"{ring}_x"] = line(inner, outer, 6, "none")
        curves[f"{ring}_y"] = line(1j * inner, 1j * outer, 6, "none")
    cuts = {name: {"un": 0.0} for name in curves if name[-2:] in ("_x", "_y")}
    law = {"law": "frictionless", "gap": loads.pop("gap", 0.0)}
    return solve_case(
        materials={material.name: describe_material(material) for material in (ROCK, GRAIN)},
        curves=curves,
        regions={
            "first": {"material": "rock", "boundary": ["bore", "first_x", "joint", "first_y"]},
            "second": {"material": "grain", "boundary": ["joint", "second_x", "rim", "second_y"]},
        },
        boundary=cuts | loads.pop("boundary", {}),
        interfaces={"joint": law},
        analysis={"steps": 2},
        **loads,
    )


def widen_ring(material: Material, inner: float, outer: float, at: float, pressures: tuple[float, float]) -> float:
    """Radial displacement of a ring under an inner and an outer pressure (Lame, plane strain)."""
    area = outer**2 - inner**2
    uniform = (1 - 2 * material.poisson) * (pressures[0] * inner**2 - pressures[1] * outer**2) / area * at
    rest = (pressures[0] - pressures[1]) * inner**2 * outer**2 / (area * at)
    return (1 + material.poisson) / material.young * (uniform + rest)


def press_rings(inner_pressure: float, interference: float) -> float:
    """Contact pressure of the two rings."""
    free = widen_ring(ROCK, INNER, MIDDLE, MIDDLE, (inner_pressure, 0.0)) + interference
    one = widen_ring(ROCK, INNER, MIDDLE, MIDDLE, (0.0, 1.0))
    other = widen_ring(GRAIN, MIDDLE, OUTER, MIDDLE, (1.0, 0.0))
    return free / (other - one)


def rings_across_a_gap() -> Outcome:
    """The inner ring is widened by pressure until it meets the outer one, across a gap that a third of it closes."""
    pressure = 15.0
    gap = widen_ring(ROCK, INNER, MIDDLE, MIDDLE, (pressure / 3, 0.0))
    solved = solve_rings(gap=gap, boundary={"bore": {"pressure": pressure}})
    exact = press_rings(pressure, -gap)
    return Outcome(largest_error(solved.last.contact.traction_n, -exact), solved.unknowns)


def shrink_fit() -> Outcome:
    """An inner ring that is larger than its seat, which in-situ stress says: freed, it would grow by its strain."""
    stress = -5.0
    strain = -stress * (1 + ROCK.poisson) * (1 - 2 * ROCK.poisson) / ROCK.young
    solved = solve_rings(initial_stress={"rock": {"sxx": stress, "syy": stress}})
    exact = press_rings(0.0, strain * MIDDLE)
    return Outcome(largest_error(solved.last.contact.traction_n, -exact), solved.unknowns)


PROOFS = (
    Proof("bonded inclusion, 48 elements: tractions", "Goodier 1933, Eshelby 1957", 2e-3, bonded_inclusion),
    Proof("smooth inclusion, 48 elements: pressure", "Muskhelishvili", 2e-3, smooth_inclusion),
    Proof("circular hole, 48 elements: displacement of the wall", "Kirsch 1898", 2e-3, hole_displacement),
    Proof("circular hole, 48 elements: stress inside", "Kirsch 1898", 2e-3, hole_stress),
    Proof("circular hole, 48 elements: hoop stress", "Kirsch 1898", 2e-3, hole_hoop_stress),
    Proof("ring widened into a ring across a gap: pressure", "Lame", 2e-3, rings_across_a_gap),
    Proof("ring pressed into a smaller ring: pressure", "Lame", 2e-3, shrink_fit),
)
