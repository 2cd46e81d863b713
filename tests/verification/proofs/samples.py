"""Rock samples with a closed crack or a joint that slides: the hysteresis of a cycle of load.

A closed crack of length 2 b at the angle psi to a compression s, friction f, in an area A. What friction does not carry
of the shear opens a slip (4/E') tau sqrt(b^2 - x^2), whose integral 2 pi b^2 tau/E' shortens the sample, along the
compression, by its projection sin psi cos psi over A (reciprocal theorem):

    first loading    tau = s sin psi (cos psi - f sin psi):  slope  1/E' + k (cos psi - f sin psi)
    unloading        the crack sticks:                       slope  1/E'
    below s1 (cos psi - f sin psi)/(cos psi + f sin psi) it slips back: slope  1/E' + k (cos psi + f sin psi)

with k = 2 pi b^2 sin^2 psi cos psi/(E' A). Walsh, Journal of Geophysical Research 70 (1965); David, Brantut, Schubnel,
Zimmerman, International Journal of Rock Mechanics and Mining Sciences 52 (2012).
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from pbem.contact.laws import SLIP, STICK
from tests.verification.proofs.proof import (
    Complex,
    Integer,
    Outcome,
    Proof,
    Real,
    Solved,
    Table,
    largest_error,
    line,
    solve_case,
)

YOUNG, POISSON = 25e3, 0.25
MODULUS = YOUNG / (1 - POISSON**2)
FRICTION, PSI = 0.5, math.radians(35.0)
SINE, COSINE = math.sin(PSI), math.cos(PSI)
SIDE, LOAD = 40.0, 100.0
SLIDES, RETURNS = COSINE - FRICTION * SINE, COSINE + FRICTION * SINE
TURN = SLIDES / RETURNS  # where reverse slip begins, of the largest load


def solve_sample(curves: Table, regions: Table, interfaces: Table, stages: list[Table]) -> Solved:
    """A free square sample of the given curves; its upper and lower side are named top and bottom."""
    return solve_case(
        materials={"slate": {"young": YOUNG, "poisson": POISSON}},
        curves=curves,
        regions=regions,
        interfaces=interfaces,
        stages=stages,
    )


def press(name: str, load: float, steps: int) -> Table:
    """A stage at whose end both sides are under a pressure."""
    sides = {side: {"ty": sign * load} for side, sign in (("top", -1.0), ("bottom", 1.0))}
    return {"name": name, "steps": steps, "boundary": sides}


def solve_cycles(cohesion: float = 0.0) -> Solved:
    """Two cycles of load on a square sample with a crack of half-length 1 in its middle."""
    half = 0.5 * SIDE
    corners = [complex(x, y) for x, y in ((-half, -half), (half, -half), (half, half), (-half, half))]
    names = ["bottom", "right", "top", "left"]
    curves = {name: line(corners[k], corners[(k + 1) % 4], 8, "none") for k, name in enumerate(names)}
    along = complex(np.exp(1j * (0.5 * math.pi - PSI)))
    cycle = [("load", LOAD, 2), ("unload", TURN * LOAD, 2), ("return", 0.0, 2)]
    return solve_sample(
        curves | {"crack": line(-along, along, 8)},
        {"sample": {"material": "slate", "boundary": names, "cracks": ["crack"]}},
        # What slip is left presses the faces apart by next to nothing, which the cohesive crack can bear.
        {"crack": {"friction": FRICTION, "cohesion": cohesion, "tensile_strength": 0.2 * cohesion}},
        [press(f"{name}{number}", load, steps) for number in (1, 2) for name, load, steps in cycle],
    )


def shortening(solved: Solved) -> Real:
    """Mean strain along the load after rest and after each step, compression positive."""
    top, bottom = solved.nodes("top"), solved.nodes("bottom")
    weight = solved.mesh.weight

    def mean(displacement: Complex, nodes: Integer) -> float:
        return float(weight[nodes] @ displacement[nodes].imag / weight[nodes].sum())

    height = float(np.ptp(solved.mesh.position.imag[[*top, *bottom]]))
    return np.array(
        [0.0, *((mean(one.displacement, bottom) - mean(one.displacement, top)) / height for one in solved.steps)]
    )


# Steps of a cycle (2 in each stage), the expected extra slope in units of k, and what all pairs do.
LEGS = {"loading": (0, SLIDES, SLIP), "unloading": (2, 0.0, STICK), "reverse slip": (4, RETURNS, SLIP)}


def slope(leg: str, cycle: int) -> Outcome:
    """Slope of a leg of a cycle beyond that of the intact sample; relative to that of first loading."""
    solved = solve_cycles()
    first, factor, mode = LEGS[leg]
    first += 6 * cycle
    loads = LOAD * np.array([0, 0.5, 1, 0.5 * (1 + TURN), TURN, 0.5 * TURN] * 2 + [0.0])
    strain = shortening(solved)
    # Both halves of the leg count.
    found = np.diff(strain[first : first + 3]) / np.diff(loads[first : first + 3]) - 1 / MODULUS
    k = 2 * math.pi * SINE**2 * COSINE / (MODULUS * SIDE**2)
    # Not looked at in the second half, at whose end the unloaded crack is about to slip back.
    assert (solved.steps[first].contact.mode == mode).all()
    return Outcome(largest_error(found, k * factor, k * (factor or SLIDES)), solved.unknowns)


def whole_slope(leg: str) -> Outcome:
    """The slope itself."""
    solved = solve_cycles()
    first, factor, _ = LEGS[leg]
    loads = LOAD * np.array([0, 1, TURN, 0])[first // 2 : first // 2 + 2]
    strain = shortening(solved)[[first, first + 2]]
    k = 2 * math.pi * SINE**2 * COSINE / (MODULUS * SIDE**2)
    exact = 1 / MODULUS + k * factor
    return Outcome(largest_error(np.diff(strain) / np.diff(loads), exact), solved.unknowns)


def closed_loop() -> Outcome:
    """After each cycle the sample is as before, and the second cycle is the first; relative to the strain of slip."""
    strain = shortening(solve_cycles())
    error = max(abs(strain[6]), abs(strain[12]), np.abs(strain[6:] - strain[:7]).max())
    return Outcome(float(error / abs(strain[2] - LOAD / MODULUS)), solve_cycles().unknowns)


COHESION = 5.0


def left_strain() -> Outcome:
    """Strain that cohesion c keeps after the load is gone, of a slip (4/E') c sqrt(b^2 - x^2) that it holds."""
    solved = solve_cycles(COHESION)
    exact = 2 * math.pi * SINE * COSINE * COHESION / (MODULUS * SIDE**2)
    return Outcome(largest_error(shortening(solved)[6], exact), solved.unknowns)


def closed_second_loop() -> Outcome:
    """With cohesion the second cycle leaves what the first one left; relative to that."""
    solved = solve_cycles(COHESION)
    strain = shortening(solved)
    return Outcome(largest_error(strain[12], strain[6]), solved.unknowns)


def dissipation() -> Outcome:
    """Energy dissipated in the first cycle, by friction times slip, which both grow in proportion."""
    solved = solve_cycles()
    slip = 2 * math.pi * LOAD * SINE * SLIDES / MODULUS  # integral along the crack at the largest load
    exact = 0.5 * FRICTION * SINE**2 * LOAD * (1 + TURN) * slip
    return Outcome(largest_error(solved.energies()[5].dissipated, exact), solved.unknowns)


def energy_balance() -> Outcome:
    """What loads do beyond what is stored and dissipated, after any step; relative to the largest stored energy."""
    solved = solve_cycles()
    energies = solved.energies()
    left = max(abs(one.external - one.elastic - one.dissipated) for one in energies)
    return Outcome(left / max(one.elastic for one in energies), solved.unknowns)


NORMAL_STIFFNESS, TANGENTIAL_STIFFNESS = 4e3, 1.5e3


def jointed_sample() -> Outcome:
    """A sample cut by an elastic joint that sticks: 1/E' and the joint's jumps, projected, over the height."""
    half, width = 2.0, 1.0
    rise = width * COSINE / SINE  # of the joint, at psi to the load, over half the width
    points = {
        "bottom": (-width - 1j * half, width - 1j * half), "right_low": (width - 1j * half, width + 1j * rise),
        "right_up": (width + 1j * rise, width + 1j * half), "top": (width + 1j * half, -width + 1j * half),
        "left_up": (-width + 1j * half, -width - 1j * rise), "left_low": (-width - 1j * rise, -width - 1j * half),
        "joint": (-width - 1j * rise, width + 1j * rise),
    }  # fmt: skip
    solved = solve_sample(
        {name: line(*ends, 6, "none") for name, ends in points.items()},
        {"lower": {"material": "slate", "boundary": ["bottom", "right_low", "joint", "left_low"]},
         "upper": {"material": "slate", "boundary": ["joint", "right_up", "top", "left_up"]}},
        {"joint": {"law": "coulomb", "friction": 2.0, "normal_stiffness": NORMAL_STIFFNESS,
                   "tangential_stiffness": TANGENTIAL_STIFFNESS}},
        [press("load", LOAD, 1)],
    )  # fmt: skip
    closing, sliding = SINE**2 / NORMAL_STIFFNESS, SINE * COSINE / TANGENTIAL_STIFFNESS
    exact = 1 / MODULUS + (closing * SINE + sliding * COSINE) / (2 * half)
    return Outcome(largest_error(shortening(solved)[-1] / LOAD, exact), solved.unknowns)


SOURCE = "Walsh 1965, David et al. 2012"
PROOFS = (
    *(Proof(f"sample with a sliding crack, {leg}: slope", SOURCE, 1e-2, partial(whole_slope, leg)) for leg in LEGS),
    *(
        Proof(f"sample with a sliding crack, {leg} {cycle + 1}: slope beyond the intact one", SOURCE, 1e-2,
              partial(slope, leg, cycle))
        for cycle in (0, 1)
        for leg in LEGS
    ),
    Proof("sample with a sliding crack: the loop closes", SOURCE, 1e-8, closed_loop),
    Proof("sample with a cohesive crack: strain left by a cycle", SOURCE, 1e-2, left_strain),
    Proof("sample with a cohesive crack: the second loop closes", SOURCE, 1e-8, closed_second_loop),
    Proof("sample with a sliding crack: dissipated energy of a cycle", SOURCE, 1e-2, dissipation),
    Proof("sample with a sliding crack: energy balance", "first law", 1e-5, energy_balance),
    Proof("sample with an elastic joint: slope", "springs in series", 1e-8, jointed_sample),
)  # fmt: skip
