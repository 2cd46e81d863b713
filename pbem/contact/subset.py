"""Contact of some pairs while all others keep their modes: the modes of these few, found by pivoting.

With the other pairs' laws linear, the states of s pairs are affine in 2 s numbers d, state = state_0 + R d, and where
tractions determine them so are the jumps in the tractions, g = g_0 + A p: A is the pairs' compliance. Coulomb's law of
one step then is a linear complementarity problem (A. Klarbring, Comput. Methods Appl. Mech. Eng. 58, 1986), here in the
form of D. E. Stewart and J. C. Trinkle (Int. J. Numer. Methods Eng. 39, 1996). With N = tensile strength - pressure -
p_n >= 0, friction traction p_s = b_+ - b_-, both >= 0, and a size of the slip l >= 0,

    g_n >= 0 to N,   l - slip >= 0 to b_+,   l + slip >= 0 to b_-,   cohesion + friction N - b_+ - b_- >= 0 to l

each with its partner of product zero (the friction traction has the sense of the slip: see pbem.contact.modes). The
matrix is copositive where -A is positive definite, as it is in every sound model, and then Lemke's pivoting ends with a
solution for any friction. Two facts do not fit in: a pair that parts loses its cohesion and its tensile strength at
once. Such pairs are taken out of their contact altogether ("detached") or not at all, one choice after another, and
what pivoting finds is asked to agree with the choice. Whatever is found has to pass the same judge as in Newton's
method, with states from its modes by a linear system.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from pbem.contact.laws import (
    OPEN,
    SLIP,
    STICK,
    Memory,
    ModeState,
    PairLaws,
    PairState,
    evaluate_strength,
    plastic_slip,
    resists_slip,
)
from pbem.contact.modes import Proposal, limit_changes, tensile_limit
from pbem.contact.pivoting import solve_by_pivoting

Real = NDArray[np.float64]
Bool = NDArray[np.bool_]
Integer = NDArray[np.int64]

# Choices of detached pairs that are followed from one to the next, and beyond that tried one by one. Those of more
# pairs than are pivoted quickly are the fewer, as pivoting costs the cube of their number.
MOST_FOLLOWED, LEAST_FOLLOWED, QUICK = 60, 3, 60
MOST_ENUMERATED = 6
# The most pairs that are pivoted; Newton's steps among them cost a hundredth of it.
MOST_PIVOTED = 300
# Newton's steps among the pairs of a group, each far cheaper than a solution with all.
MOST_STEPS = 100
# Where modes come back, only violations of this share of the largest change; at last one pair at a time.
SHARES = (0.0, 0.3, 1.0)
# Cohesion this small, relative to the largest normal traction, is none; and what keeps bounds of zero apart.
ROUNDING, PERTURBATION = 1e-12, 1e-10
# Tractions that some motion hardly changes leave a body free without these pairs.
FREE = 1e-11
# Stiffness of the springs that then hold it, relative to that of its surroundings.
SPRING = 1e-5


@dataclass(frozen=True)
class Response:
    """States that s pairs can have while all others keep their modes: values (s, 4) + change (s, 4, 2 s) @ d.

    values: p_n, p_s, g_n, g_s at present, in units in which numbers are of one size: a traction is `traction_unit`
    times its number, a jump `length_unit` times.
    """

    values: Real
    change: Real
    traction_unit: float
    length_unit: float

    def evaluate(self, d: Real) -> PairState:
        """The pairs' states for d (2 s,)."""
        state = (self.values + self.change @ d).T
        return PairState(
            state[0] * self.traction_unit, state[1] * self.traction_unit,
            state[2] * self.length_unit, state[3] * self.length_unit,
        )  # fmt: skip


@dataclass(frozen=True)
class Subset:
    """Laws, memory and pressure of s pairs, and their modes at present."""

    laws: PairLaws
    memory: Memory
    pressure: Real
    modes: ModeState


def take_subset(laws: PairLaws, memory: Memory, pressure: Real, modes: ModeState, pairs: Integer) -> Subset:
    """What concerns some pairs (s,), in rising order, each of which takes a mode of its own."""
    groups = []
    for group in laws.strengths:
        inside = np.isin(group.pairs, pairs)
        parameters = {name: values[inside] for name, values in group.parameters.items()}
        groups.append(replace(group, pairs=np.searchsorted(pairs, group.pairs[inside]), parameters=parameters))
    arrays = {name: getattr(laws, name)[pairs] for name in vars(laws) if name not in ("strengths", "leader")}
    arrays["leader"] = np.arange(len(pairs))
    return Subset(
        PairLaws(strengths=tuple(groups), **arrays),
        Memory(
            _take_modes(memory.modes, pairs), memory.slip[pairs], memory.path[pairs], memory.broken[pairs],
            memory.normal_traction[pairs],
        ),
        pressure[pairs],
        _take_modes(modes, pairs),
    )  # fmt: skip


def _take_modes(modes: ModeState, pairs: Integer) -> ModeState:
    return ModeState(modes.mode[pairs], modes.sign[pairs])


@dataclass(frozen=True)
class Settled:
    """Admissible modes of the pairs, or the reason why there are none.

    modes: None if none were found. exhaustive: whether then every choice was tried and there are none at all (while the
    other pairs keep their modes). tried: number of complementarity problems that were solved. wrong (s,): pairs whose
    own compliance has the wrong sign, on meshes that cannot carry contact.
    """

    modes: ModeState | None
    exhaustive: bool
    tried: int
    wrong: Bool


def settle_subset(
    subset: Subset, response: Response, judge: Callable[[ModeState, PairState], Proposal],
    holds: Callable[[ModeState], bool] = lambda modes: True,
) -> Settled:
    """Find modes of s pairs that `judge` leaves as they are; the judge sees modes and states of these pairs alone.

    holds: whether all bodies are held in modes of these pairs.
    """
    problem = _pose(subset, response)
    loses = (problem.adhesion > 0) | (tensile_limit(subset.laws, subset.memory) > 0)
    compliance, sprung = _find_compliance(problem)
    none = np.zeros(len(loses), dtype=bool)
    if compliance is None:
        return Settled(None, False, 0, none)
    wrong = none if sprung else (np.diag(compliance) >= 0).reshape(2, -1).any(axis=0)
    stepped = _step(problem, subset.modes, response, judge, holds)
    if stepped is not None:
        return Settled(stepped, False, 0, wrong)
    if len(loses) > MOST_PIVOTED:
        return Settled(None, False, 0, wrong)
    tried: set[bytes] = set()
    complete = True
    for detached in _choose_detached(subset.modes.mode == OPEN, loses):
        follow: Bool | None = detached
        while follow is not None and follow.tobytes() not in tried and len(tried) < _most_tried(loses):
            tried.add(follow.tobytes())
            modes = _pivot(problem, compliance, follow)
            if modes is None:
                complete = False
                break
            d = _solve_in_modes(problem, modes)
            if d is None:  # a body that these modes leave free: it has to be held, and cannot be judged here
                return Settled(modes, False, len(tried), wrong)
            proposal = judge(modes, response.evaluate(d))
            if not proposal.changed.any():
                return Settled(modes, False, len(tried), wrong)
            follow = _follow(proposal, loses, follow, tried)
    # Friction alone always has admissible modes: what pivoting finds of it and the judge refuses is ill-conditioned.
    return Settled(None, complete and bool(loses.any()) and len(tried) >= 2 ** int(loses.sum()), len(tried), wrong)


def _step(
    problem: _Pairs, modes: ModeState, response: Response, judge: Callable[[ModeState, PairState], Proposal],
    holds: Callable[[ModeState], bool],
) -> ModeState | None:
    """Modes by Newton's steps among these pairs alone; None where they come back, take too many or free a body.

    Along a slender wedge the end of contact moves by an element or two in a step, however many there are.
    """
    for share in SHARES:
        if share == 1.0 and len(modes.mode) > MOST_STEPS:  # it would not come to the end
            break
        seen: set[bytes] = set()
        while len(seen) < MOST_STEPS and modes.fingerprint() not in seen:
            seen.add(modes.fingerprint())
            d = _solve_in_modes(problem, modes) if holds(modes) else None
            if d is None:
                return None
            proposal = judge(modes, response.evaluate(d))
            if not proposal.changed.any():
                return modes
            modes = limit_changes(modes, proposal, share)
    return None


def _follow(proposal: Proposal, loses: Bool, detached: Bool, tried: set[bytes]) -> Bool | None:
    """The next choice of detached pairs: what the judge says of all of them, or, where that was tried, of the worst."""
    wanted = loses & (proposal.modes.mode == OPEN)
    if wanted.tobytes() not in tried:
        return wanted
    for pair in np.argsort(-proposal.violation, kind="stable"):
        if wanted[pair] != detached[pair]:
            one = detached.copy()
            one[pair] = wanted[pair]
            if one.tobytes() not in tried:
                return one
    return None


def _most_tried(loses: Bool) -> int:
    few = int(loses.sum())
    followed = int(MOST_FOLLOWED * min(1.0, QUICK / len(loses)) ** 3)
    return max(followed, LEAST_FOLLOWED) + (2**few if few <= MOST_ENUMERATED else 0)


def _choose_detached(is_open: Bool, loses: Bool) -> Iterator[Bool]:
    """First the pairs that are open now; then, if they are few, every choice."""
    yield is_open & loses
    own = np.flatnonzero(loses)
    if len(own) <= MOST_ENUMERATED:
        for choice in product((False, True), repeat=len(own)):
            detached = np.zeros(len(loses), dtype=bool)
            detached[own] = choice
            yield detached


@dataclass(frozen=True)
class _Pairs:
    """What the pairs can be (s,), in the response's units.

    constant (4, s), change (4, s, 2 s): of p_n, p_s, g_n and this step's slip, the jumps less those of elastic joints.
    The bound is adhesion + friction N, N = limit - p_n; limit: tensile strength - pressure. tension: tensile strength.
    rough: pairs with a bound at all.
    """

    constant: Real
    change: Real
    adhesion: Real
    friction: Real
    limit: Real
    tension: Real
    rough: Bool
    sign: Real


def _pose(subset: Subset, response: Response) -> _Pairs:
    laws, memory = subset.laws, subset.memory
    unit = response.traction_unit
    tension = tensile_limit(laws, memory)
    limit = tension - subset.pressure
    elastic = np.stack([laws.compliance_n, laws.compliance_s]) * (unit / response.length_unit)
    constant, change = response.values.T.copy(), response.change.transpose(1, 0, 2).copy()
    change[2:] -= elastic[:, :, None] * change[:2]
    constant[2:] -= elastic * constant[:2]
    constant[3] -= memory.slip / response.length_unit
    state = response.evaluate(np.zeros(2 * laws.count))
    admissible = np.minimum(state.p_n, limit)
    ahead = np.where(subset.modes.mode == SLIP, np.abs(plastic_slip(laws, state) - memory.slip), 0.0)
    strength = evaluate_strength(laws, admissible, memory.path + ahead, subset.pressure, memory.broken)
    friction = -strength.by_traction
    adhesion = (strength.bound - friction * (limit - admissible)) / unit
    adhesion = np.where(adhesion > ROUNDING * np.abs(constant[0]).max(initial=0.0), adhesion, 0.0)
    return _Pairs(
        constant, change, adhesion, friction, limit / unit, tension / unit, resists_slip(laws), subset.modes.sign
    )  # fmt: skip


def _find_compliance(pairs: _Pairs) -> tuple[Real | None, bool]:
    """What tractions (p_n of all pairs, then p_s) do to the jumps, (2 s, 2 s); None if that cannot be found.

    Where the tractions leave a body free, as pairs that alone hold it do, soft springs tie its faces to where they are:
    then the second value is True.
    """
    count = len(pairs.sign)
    tractions, jumps = (pairs.change[k : k + 2].reshape(2 * count, 2 * count) for k in (0, 2))
    values = np.linalg.svd(tractions, compute_uv=False)
    sprung = bool(values[-1] <= FREE * values[0])
    if sprung:
        tractions = tractions - SPRING * values[0] / np.linalg.norm(jumps, 2) * jumps
    try:
        found = jumps @ np.linalg.inv(tractions)
    except np.linalg.LinAlgError:
        return None, sprung
    return (found if np.isfinite(found).all() else None), sprung


def _pivot(pairs: _Pairs, compliance: Real, detached: Bool) -> ModeState | None:
    """The modes of the complementarity problem in which some pairs are detached; None where pivoting fails.

    (theory, 56)
    """
    count = len(detached)
    # In a unit of length in which compliances are numbers of about one.
    softness = float(np.abs(np.diag(compliance)).mean()) or 1.0
    compliance = compliance / softness
    # The pairs that may touch, with N and the friction traction zero.
    closed = np.flatnonzero(~detached)
    rough = np.flatnonzero(pairs.rough[closed])
    rest = np.concatenate([np.where(detached, pairs.limit - pairs.tension, pairs.limit), np.zeros(count)])
    jump = pairs.constant[2:].ravel() / softness + compliance @ (rest - pairs.constant[:2].ravel())
    own = np.concatenate([closed, count + closed[rough]])
    n, r = len(closed), len(rough)
    matrix = np.zeros((n + 3 * r, n + 3 * r))
    # Columns: what N, b_+, b_- and l do; rows: g_n, l - slip, l + slip, and what is left of the bound.
    part = compliance[np.ix_(own, own)]
    opening, slip = part[:n], part[n:]
    matrix[:n] = np.hstack([-opening[:, :n], opening[:, n:], -opening[:, n:], np.zeros((n, r))])
    along = np.hstack([-slip[:, :n], slip[:, n:], -slip[:, n:]])
    matrix[n : n + 2 * r, : n + 2 * r] = np.vstack([-along, along])
    size = n + np.arange(2 * r).reshape(2, r)
    last = n + 2 * r + np.arange(r)
    matrix[size[0], last] = matrix[size[1], last] = 1.0
    matrix[last, size[0]] = matrix[last, size[1]] = -1.0
    matrix[last, rough] = pairs.friction[closed[rough]]
    slip_at_rest = jump[count + closed[rough]]
    constant = np.concatenate([jump[closed], -slip_at_rest, slip_at_rest, pairs.adhesion[closed[rough]]])
    # Many bounds are zero at rest: unequal small numbers keep the pivoting from going round among them.
    constant += PERTURBATION * np.abs(constant).max(initial=0.0) * (1 + np.arange(len(constant)) * 0.6180339887 % 1)
    found = solve_by_pivoting(matrix, constant)
    if found.ended != "solution":
        return None
    mode, sign = np.full(count, OPEN, dtype=np.int8), pairs.sign.copy()
    mode[closed[found.basic[:n]]] = np.where(pairs.rough[closed[found.basic[:n]]], STICK, SLIP)
    slides = closed[rough[found.basic[last] & found.basic[rough]]]
    mode[slides] = SLIP
    forward = np.zeros(count, dtype=bool)
    forward[closed[rough]] = found.z[size[0]] > found.z[size[1]]
    sign[slides] = np.where(forward[slides], 1.0, -1.0)
    return ModeState(mode, sign)


def _solve_in_modes(pairs: _Pairs, modes: ModeState) -> Real | None:
    """d (2 s,) for which every pair fulfils the equations of its mode; None if there is none, or not one alone."""
    is_open, slides = modes.mode == OPEN, modes.mode == SLIP
    by_normal = -modes.sign * np.where(pairs.rough, pairs.friction, 0.0)
    bound = modes.sign * np.where(pairs.rough, pairs.adhesion + pairs.friction * pairs.limit, 0.0)
    first = np.where(is_open[:, None], pairs.change[0], pairs.change[2])
    given = np.where(is_open, pairs.limit - pairs.tension - pairs.constant[0], -pairs.constant[2])
    tangential = pairs.change[1] - np.where(slides, by_normal, 0.0)[:, None] * pairs.change[0]
    friction = np.where(slides, bound + by_normal * pairs.constant[0], 0.0) - pairs.constant[1]
    sticks = modes.mode == STICK
    second = np.where(sticks[:, None], pairs.change[3], tangential)
    try:
        d: Real = np.linalg.solve(
            np.concatenate([first, second]), np.concatenate([given, np.where(sticks, -pairs.constant[3], friction)])
        )
    except np.linalg.LinAlgError:
        return None
    return d if np.isfinite(d).all() else None
