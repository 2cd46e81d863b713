"""Ways to cut a crack into curves and to grade each of them, made from a seed; and how well its tips are known."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from pbem.exact import arc_crack_intensity, arc_crack_parallel_stress
from pbem.geometry.curve import Leg
from pbem.model.crack import find_tips
from pbem.model.material import Material
from pbem.model.model import Model
from pbem.results.tips import collect_tip_rules
from tests.verification.planes import ROCK, make_plane, solve


@dataclass(frozen=True)
class Tips:
    """KI, |KII|, J, T at the first and the last tip of a crack."""

    KI: tuple[float, float]
    KII: tuple[float, float]
    J: tuple[float, float]
    T: tuple[float, float]


@dataclass(frozen=True)
class Way:
    """A crack in a plane as legs, each a curve of its own; what is right; the stress far away, for errors of T."""

    legs: tuple[Leg, ...]
    remote: tuple[float, float, float]
    material: Material
    order: int
    exact: Tips
    stress: float
    text: str


@dataclass(frozen=True)
class Errors:
    """Largest errors: of KI and KII relative to the root of the sum of their squares, of J to itself, of T to the
    stress far away."""

    KI: float
    KII: float
    J: float
    T: float


@dataclass(frozen=True)
class Straight:
    """A straight crack of half-length `half` about `middle`, in the direction `along`, under `stress` across it,
    `parallel` along it and `shear`; remote: sxx, syy, sxy of the same state."""

    half: float
    stress: float
    along: complex
    middle: complex
    parallel: float
    shear: float
    remote: tuple[float, float, float]


def draw_straight(rng: np.random.Generator) -> Straight:
    """A straight crack anywhere, in any direction and in any units, under any stress that opens it."""
    half, stress = 10 ** rng.uniform(-6, 6), 10 ** rng.uniform(-3, 9)
    along = np.exp(2j * np.pi * rng.random())
    middle = half * complex(rng.uniform(-10, 10), rng.uniform(-10, 10))
    parallel, shear = rng.uniform(-1, 1, 2) * stress
    # s_xx + s_yy and s_yy - s_xx + 2 i s_xy turn with the axes.
    turned = (stress - parallel + 2j * shear) * np.conj(along) ** 2
    remote = (0.5 * (parallel + stress - turned.real), 0.5 * (parallel + stress + turned.real), 0.5 * turned.imag)
    return Straight(half, stress, along, middle, parallel, shear, remote)


def make_griffith(seed: int) -> Way:
    """A straight crack anywhere, in any direction and in any units, under any stress that opens it."""
    rng = np.random.default_rng(seed)
    drawn = draw_straight(rng)
    half, stress, along, middle = drawn.half, drawn.stress, drawn.along, drawn.middle
    order = int(rng.integers(1, 4))
    legs = _cut(rng, Leg(complex(middle - half * along), complex(middle + half * along), 1))
    root = math.sqrt(math.pi * half)
    KI, KII = stress * root, abs(drawn.shear) * root
    material = Material("rock", 1e3 * stress, 0.3)
    exact = _make_tips(KI, KII, (KI**2 + KII**2) / material.plane_modulus, drawn.parallel - stress)
    return Way(legs, drawn.remote, material, order, exact, stress, _describe("griffith", seed, order, legs))


def make_arc_crack(seed: int) -> Way:
    """A crack along an arc of a circle of radius 1 under equal biaxial tension."""
    rng = np.random.default_rng(seed)
    half, order = math.radians(rng.uniform(10, 100)), int(rng.integers(1, 4))
    whole = Leg(complex(np.exp(-1j * half)), complex(np.exp(1j * half)), 1, center=0j, sweep=2 * half)
    legs = _cut(rng, whole)
    while max(leg.sweep * np.diff(leg.element_fractions()).max() for leg in legs) > math.radians(30):
        legs = _cut(rng, whole)
    KI, KII = arc_crack_intensity(1.0, half, 1.0)
    exact = _make_tips(KI, KII, (KI**2 + KII**2) / ROCK.plane_modulus, arc_crack_parallel_stress(half, 1.0))
    return Way(legs, (1.0, 1.0, 0.0), ROCK, order, exact, 1.0, _describe("arc", seed, order, legs))


def make_kinked_crack(seed: int) -> Way:
    """A crack with a corner, towards which its legs are refined; what is right is what a fine mesh has."""
    rng = np.random.default_rng(seed)
    turn, order = np.exp(1j * math.radians(rng.uniform(15, 80))), int(rng.integers(1, 4))
    points = (-1 + 0j, 0j, complex(10 ** rng.uniform(-1, 0) * turn))
    legs = []
    for k in range(2):
        count, power = int(rng.integers(10, 25)), rng.uniform(2, 4)
        t = np.linspace(0, 1, count + 1)
        # Towards the corner, and less or more towards the tip.
        share = rng.uniform(0.2, 0.8)
        inner = np.where(t <= share, share * (t / share) ** power, 1 - (1 - share) * ((1 - t) / (1 - share)) ** power)
        fractions = inner if k else 1 - inner[::-1]
        legs.append(Leg(points[k], points[k + 1], count, fractions=tuple(fractions.tolist())))
    t = np.linspace(0, 1, 25)
    fine = np.where(t <= 0.5, 0.5 * (2 * t) ** 2.5, 1 - 0.5 * (2 * (1 - t)) ** 2.5)
    finest = tuple(replace(leg, elements=24, fractions=tuple(fine.tolist())) for leg in legs)
    remote, zeros = (0.3, 1.0, 0.2), (0.0, 0.0)
    way = Way(tuple(legs), remote, ROCK, order, Tips(zeros, zeros, zeros, zeros), 1.0,
              _describe("kink", seed, order, tuple(legs)))
    return replace(way, exact=_solve(replace(way, legs=finest, order=3)))


def limit_ratios(way: Way, most: float = 2.0) -> Way:
    """The same crack with elements halved until none is longer than a neighbour by more than the factor `most`."""
    lengths = np.array([leg.length for leg in way.legs])
    offset = np.concatenate([[0.0], np.cumsum(lengths)])
    of = np.concatenate([np.full(leg.elements, k) for k, leg in enumerate(way.legs)])
    low = np.concatenate([leg.element_fractions()[:-1] for leg in way.legs])
    high = np.concatenate([leg.element_fractions()[1:] for leg in way.legs])
    while True:
        length = (high - low) * lengths[of]
        long = np.zeros(len(of), dtype=bool)
        long[1:] |= length[1:] > most * length[:-1] * (1 + 1e-9)
        long[:-1] |= length[:-1] > most * length[1:] * (1 + 1e-9)
        if not long.any():
            break
        middle = 0.5 * (low + high)
        of = np.concatenate([of, of[long]])
        low, high = np.concatenate([low, middle[long]]), np.concatenate([np.where(long, middle, high), high[long]])
        order = np.argsort(offset[of] + low * lengths[of], kind="stable")
        of, low, high = of[order], low[order], high[order]
    legs = []
    for k, leg in enumerate(way.legs):
        fractions = tuple([*low[of == k].tolist(), 1.0])
        legs.append(replace(leg, elements=len(fractions) - 1, fractions=fractions))
    return replace(way, legs=tuple(legs))


def measure(way: Way) -> Errors:
    """Solve it, and compare with what is right."""
    found, exact = _solve(way), way.exact
    intensity = np.hypot(exact.KI, exact.KII)
    return Errors(
        KI=float((np.abs(np.subtract(found.KI, exact.KI)) / intensity).max()),
        KII=float((np.abs(np.subtract(found.KII, exact.KII)) / intensity).max()),
        J=float(np.abs(np.divide(found.J, exact.J) - 1).max()),
        T=float(np.abs(np.subtract(found.T, exact.T)).max() / way.stress),
    )


def _solve(way: Way) -> Tips:
    model = _make_model(way)
    mesh, steps = solve(model)
    rules = collect_tip_rules(model, mesh)
    is_tip = rules.is_tip.reshape(-1, 2)
    KI, KII, J, T = (values[is_tip].tolist() for values in rules.evaluate_all(steps[-1]).values())
    return Tips(tuple(KI), tuple(np.abs(KII).tolist()), tuple(J), tuple(T))


def _make_model(way: Way) -> Model:
    cracks = {f"piece {k}": [leg] for k, leg in enumerate(way.legs)}
    size = sum(leg.length for leg in way.legs)
    model = make_plane(way.remote, cracks, material=way.material, order=way.order, size=size)
    return replace(model, crack_tips=find_tips(model.curves, dict.fromkeys(cracks, "plane")))


def _cut(rng: np.random.Generator, whole: Leg) -> tuple[Leg, ...]:
    """Up to three pieces with lengths as 1:100 at most, each with its own number of elements and grading."""
    share = 10 ** rng.uniform(0, 2, rng.integers(1, 4))
    ends = np.concatenate([[0.0], np.cumsum(share) / share.sum()])
    ends[-1] = 1.0
    points = whole.point(ends)
    legs = []
    for k, part in enumerate(np.diff(ends)):
        count = int(rng.integers(4, 17))
        legs.append(replace(whole, start=complex(points[k]), end=complex(points[k + 1]), elements=count,
                            sweep=whole.sweep * part, fractions=tuple(_grade(rng, count).tolist())))
    return tuple(legs)


def _grade(rng: np.random.Generator, count: int) -> np.ndarray:
    t, power = np.linspace(0, 1, count + 1), rng.uniform(1, 6)
    towards = rng.choice(["start", "end", "both", "neither"])
    if towards == "start":
        return np.asarray(t**power)
    if towards == "end":
        return np.asarray(1 - (1 - t) ** power)
    if towards == "both":
        return np.where(t <= 0.5, 0.5 * (2 * t) ** power, 1 - 0.5 * (2 * (1 - t)) ** power)
    return t


def _make_tips(KI: float, KII: float, J: float, T: float) -> Tips:
    return Tips((KI, KI), (KII, KII), (J, J), (T, T))


def _describe(kind: str, seed: int, order: int, legs: tuple[Leg, ...]) -> str:
    lengths = [leg.length * np.diff(leg.element_fractions()) for leg in legs]
    parts = "; ".join(f"{len(each)} elements from {each[0]:.3g} to {each[-1]:.3g}" for each in lengths)
    return f"{kind}, seed {seed}, order {order}: {parts}"
