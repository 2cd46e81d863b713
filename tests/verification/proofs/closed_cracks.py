"""Closed cracks with friction and cohesion, and a crack in bending that closes in part."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import numpy as np

from pbem.contact.laws import OPEN, STICK
from pbem.exact import closed_crack
from tests.verification.proofs.cracks import ROCK, TADA
from tests.verification.proofs.proof import Outcome, Proof, Solved, largest_error, line, solve_case

SLATE = {"young": 25e3, "poisson": 0.25}
SLATE_MODULUS = 25e3 / (1 - 0.25**2)
FRICTION = math.tan(math.radians(30.0))
COMPRESSION = 100.0


@dataclass(frozen=True)
class Errors:
    """Of the factor of mode II, of the slip (relative to the largest), and of the tractions (to the compression)."""

    KII: float
    slip: float
    tractions: float


def solve_closed(degrees: float, cohesion: float) -> Solved:
    """A crack of half-length 1 at an angle to the compression along y; friction angle 30 degrees."""
    along = complex(np.exp(1j * math.radians(90 - degrees)))
    return solve_case(
        materials={"slate": SLATE},
        curves={"crack": line(-along, along, 8)},
        regions={"plane": {"material": "slate", "infinite": True, "cracks": ["crack"]}},
        interfaces={"crack": {"friction": FRICTION, "cohesion": cohesion}},
        remote={"syy": -COMPRESSION},
        analysis={"steps": 1},
    )


def measure_closed(solved: Solved, degrees: float, cohesion: float) -> Errors:
    """Against Muskhelishvili's solution; a crack whose friction carries all sticks, without any slip and factor."""
    angle = math.radians(degrees)
    exact = closed_crack(SLATE_MODULUS, 1.0, COMPRESSION, angle, FRICTION, cohesion)
    remote_shear = COMPRESSION * math.sin(angle) * math.cos(angle)
    slides = exact.shear > 0
    shear = exact.shear if slides else 0.0
    contact = solved.last.contact
    KI, KII = solved.factors("crack")
    shape = np.sqrt(1 - (solved.mesh.pairs.arc_length - 1) ** 2)
    full_slip, full_factor = 4 / SLATE_MODULUS * remote_shear, remote_shear * math.sqrt(math.pi)
    slip = 4 / SLATE_MODULUS * shear
    return Errors(
        KII=max(
            largest_error(np.abs(KII), shear * math.sqrt(math.pi), exact.KII if slides else full_factor),
            float(np.abs(KI).max()),
        ),
        slip=largest_error(np.abs(contact.slip), slip * shape, slip if slides else full_slip),
        tractions=max(
            largest_error(contact.traction_n, exact.normal_traction, COMPRESSION),
            largest_error(np.abs(contact.traction_s), remote_shear - shear, COMPRESSION),
        ),
    )


def closed_cracks(cohesion: float, quantity: str) -> Outcome:
    """The largest error over eight angles."""
    angles = (10.0, 15.0, 20.0, 25.0, 30.0, 40.0, 50.0, 55.0)
    solutions = [solve_closed(angle, cohesion) for angle in angles]
    errors = [
        getattr(measure_closed(solved, angle, cohesion), quantity)
        for solved, angle in zip(solutions, angles, strict=True)
    ]
    sticking = sum(bool((solved.last.contact.mode == STICK).all()) for solved in solutions)
    return Outcome(max(errors), solutions[0].unknowns, f"{sticking} of {len(angles)} stick")


def growing_cohesion() -> Outcome:
    """KII of a sheared crack whose cohesion grows linearly from 0 in its middle to the shear S at its tips.

    Made of curves with a cohesion each: the mean with the weight 1/sqrt(1 - x^2) of the crack's tips, for which
    KII = S sqrt(pi a) (1 - 2/pi) is exact for the steps too.
    """
    count = 10
    ends = np.linspace(0, 1, count + 1)
    mean = -np.diff(np.sqrt(1 - ends**2)) / np.diff(np.arcsin(ends))
    ends, cohesion = np.concatenate([-ends[:0:-1], ends]), np.concatenate([mean[::-1], mean])
    names = [f"part{k}" for k in range(2 * count)]
    solved = solve_case(
        materials={"rock": ROCK},
        curves={name: line(ends[k], ends[k + 1], 4, "none") for k, name in enumerate(names)},
        regions={"plane": {"material": "rock", "infinite": True, "cracks": names}},
        interfaces={name: {"cohesion": cohesion[k]} for k, name in enumerate(names)},
        remote={"syy": -1.0, "sxy": 1.0},
        analysis={"steps": 1},
    )
    found = solved.factors(names[0])[1][0], solved.factors(names[-1])[1][1]
    return Outcome(largest_error(np.abs(found), math.sqrt(math.pi) * (1 - 2 / math.pi)), solved.unknowns)


def solve_bending() -> Solved:
    """A crack of half-length 1 in a block of 40 x 40, across a stress that grows linearly along it, 1 per length.

    The block hangs from its upper side between smooth walls, so that its weight gives the stress nu/(1 - nu) syy
    across the vertical crack; a tension on the lower side makes it zero in the crack's middle.
    """
    half, poisson = 20.0, ROCK["poisson"]
    weight = (1 - poisson) / poisson  # per volume
    corners = [complex(x, y) for x, y in ((-half, -half), (half, -half), (half, half), (-half, half))]
    names = ("bottom", "right", "top", "left")
    curves = {name: line(corners[k], corners[(k + 1) % 4], 12, "none") for k, name in enumerate(names)}
    return solve_case(
        materials={"rock": ROCK | {"density": 1.0}},
        curves=curves | {"crack": line(-1j, 1j, 24, "none")},
        regions={"block": {"material": "rock", "boundary": list(names), "cracks": ["crack"]}},
        boundary={"left": {"ux": 0.0}, "right": {"ux": 0.0}, "top": {"uy": 0.0}, "bottom": {"ty": half * weight}},
        interfaces={"crack": {"law": "frictionless"}},
        gravity={"gy": -weight},
        analysis={"steps": 1},
    )


def bending_factor() -> Outcome:
    """KI at the open tip, where the crack is as one from -a/3 to a."""
    solved = solve_bending()
    exact = (2 / 3) ** 1.5 * math.sqrt(math.pi)
    return Outcome(largest_error(solved.factors("crack")[0][1], exact), solved.unknowns)


def bending_closure() -> Outcome:
    """Distance of the place where the crack closes, -a/3, from between the last closed and the first open pair."""
    solved = solve_bending()
    is_open = solved.last.contact.mode == OPEN
    place = solved.mesh.pairs.position.imag
    assert (np.diff(is_open.astype(int)) >= 0).all()
    lower, upper = place[~is_open].max(), place[is_open].min()
    return Outcome(max(lower + 1 / 3, -1 / 3 - upper, 0.0) / (2 / 24), solved.unknowns, f"{lower:.4f} .. {upper:.4f}")


PROOFS = (
    *(
        Proof(f"closed crack, cohesion {cohesion:g}, eight angles: {what}", "Muskhelishvili", tolerance,
              partial(closed_cracks, cohesion, quantity))
        for cohesion in (0.0, 10.0)
        for what, quantity, tolerance in (("KII", "KII", 1e-3), ("slip", "slip", 1e-3),
                                          ("tractions", "tractions", 1e-8))
    ),
    Proof("sheared crack, cohesion growing linearly: KII", TADA, 1e-3, growing_cohesion),
    Proof("crack in bending that closes in part: KI", "Bowie, Freese 1976", 1e-2, bending_factor),
    Proof("crack in bending that closes in part: closing point, in elements", "Bowie, Freese 1976", 0.5,
          bending_closure),
)  # fmt: skip
