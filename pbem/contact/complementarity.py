"""The contact of some pairs while all others keep their modes, as a linear complementarity problem.

With the other pairs' laws linear, the states of s pairs are affine in 2 s numbers d, state = state_0 + R d, and where
tractions determine them so are the jumps in the tractions, g = g_0 + A p: A is the pairs' compliance. Coulomb's law of
one step then is a linear complementarity problem (A. Klarbring, Comput. Methods Appl. Mech. Eng. 58, 1986), here in the
form of D. E. Stewart and J. C. Trinkle (Int. J. Numer. Methods Eng. 39, 1996). With N = tensile strength - pressure -
p_n >= 0, friction traction p_s = b_+ - b_-, both >= 0, and a size of the slip l >= 0,

    g_n - climb l >= 0 to N,   l - slip >= 0 to b_+,   l + slip >= 0 to b_-,
    cohesion + friction N - b_+ - b_- >= 0 to l

each with its partner of product zero (the friction traction has the sense of the slip: see pbem.contact.modes); climb:
of faces that dilate, at most the friction. The matrix is copositive where -A is positive definite, as it is in every
sound model, and then Lemke's pivoting ends with a solution for any friction.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.linalg.lapack import dgecon, dgesvx, dgetrf, dgetrs

from pbem.arrays import Bool, Integer, Real
from pbem.contact.laws import (
    OPEN,
    SLIP,
    STICK,
    Memory,
    ModeState,
    PairLaws,
    PairState,
    StrengthGroup,
    evaluate_strength,
    plastic_slip,
    resists_slip,
    tensile_limit,
)
from pbem.contact.pivoting import OperationCount, pivot_from
from pbem.contact.seat import evaluate_dilation, read_dilation

# Cohesion this small, relative to the largest normal traction, is none; and what keeps bounds of zero apart.
ROUNDING, PERTURBATION = 1e-12, 1e-10
# A bound bends if its tangent at the traction of a pair meets the axis off from it by more than this part.
BENT = 1e-9
# Tractions that some motion hardly changes leave a body free without these pairs.
FREE = 1e-11
# Estimates of the reciprocal condition (of sums of columns) that tell without singular values that none does.
HELD = 1e-6
# Equations of modes whose reciprocal condition is less leave a body free: their solution would be rounding. Those of
# bodies that are held have 1e-5 and more.
REGULAR = 1e-12
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
    """Laws, memory and pressure of s pairs, and their modes at present; effort: what their problems may take."""

    laws: PairLaws
    memory: Memory
    pressure: Real
    modes: ModeState
    effort: OperationCount = field(default_factory=OperationCount)


def take_subset(laws: PairLaws, memory: Memory, pressure: Real, modes: ModeState, pairs: Integer) -> Subset:
    """What concerns some pairs (s,), some of them more than once, each of which takes a mode of its own."""
    groups = []
    for group in laws.strengths:
        if not len(group.pairs):
            continue
        inside, place = _find_members(group, laws.count, pairs)
        if not len(inside):  # laws of one's own are not asked about no pairs
            continue
        parameters = {name: values[place] for name, values in group.parameters.items()}
        groups.append(replace(group, pairs=inside, parameters=parameters))
    arrays = {name: getattr(laws, name)[pairs] for name in vars(laws) if name not in ("strengths", "leader")}
    arrays["leader"] = np.arange(len(pairs))
    return Subset(
        PairLaws(strengths=tuple(groups), **arrays),
        Memory(
            _take_modes(memory.modes, pairs), memory.slip[pairs],
            {name: values[pairs] for name, values in memory.internal.items()}, memory.normal_traction[pairs],
            memory.opening[pairs], memory.duration,
        ),
        pressure[pairs],
        _take_modes(modes, pairs),
    )  # fmt: skip


def _find_members(group: StrengthGroup, count: int, pairs: Integer) -> tuple[Integer, Integer]:
    """Which of some pairs (s,), of all the count, are of a group, and their places in it."""
    if len(group.pairs) == count:  # they rise
        return np.arange(len(pairs)), pairs
    place = np.minimum(np.searchsorted(group.pairs, pairs), len(group.pairs) - 1)
    inside = np.flatnonzero(group.pairs[place] == pairs)
    return inside, place[inside]


def _take_modes(modes: ModeState, pairs: Integer) -> ModeState:
    return ModeState(modes.mode[pairs], modes.sign[pairs])


@dataclass(frozen=True)
class PairProblem:
    """What the pairs can be (s,), in the response's units.

    constant (4, s), change (4, s, 2 s): of p_n, p_s, g_n and this step's slip, the jumps less those of elastic joints
    and the opening at which faces touch, which rises by climb times the size of the slip.
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
    climb: Real
    effort: OperationCount


def pose(subset: Subset, response: Response) -> PairProblem:
    """What the pairs of a subset can be with their laws as they are at the states of the response."""
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
    strength = evaluate_strength(laws, admissible, memory.look_ahead(ahead), subset.pressure)
    friction = -strength.by_traction
    adhesion = strength.bound - friction * (limit - admissible)
    # Of a bound that bends the chord, as the tangent would adhere.
    bottom = evaluate_strength(laws, limit, memory.look_ahead(ahead), subset.pressure).bound
    bends = adhesion - bottom > BENT * strength.bound
    chord = (strength.bound - bottom) / np.where(bends, limit - admissible, 1.0)
    friction, adhesion = np.where(bends, chord, friction), np.where(bends, bottom, adhesion) / unit
    rises = evaluate_dilation(laws, admissible, memory.look_ahead(ahead), subset.pressure)
    seat = read_dilation(laws, memory.internal) + rises.opening - rises.by_slip * ahead
    constant[2] -= seat / response.length_unit
    adhesion = np.where(adhesion > ROUNDING * np.abs(constant[0]).max(initial=0.0), adhesion, 0.0)
    return PairProblem(
        constant, change, adhesion, friction, limit / unit, tension / unit, resists_slip(laws), subset.modes.sign,
        rises.by_slip, subset.effort,
    )  # fmt: skip


def find_compliance(pairs: PairProblem) -> tuple[Real | None, bool]:
    """What tractions (p_n of all pairs, then p_s) do to the jumps, (2 s, 2 s); None if that cannot be found.

    Where the tractions leave a body free, as pairs that alone hold it do, soft springs tie its faces to where they are:
    then the second value is True.
    """
    count = len(pairs.sign)
    tractions, jumps = (pairs.change[k : k + 2].reshape(2 * count, 2 * count) for k in (0, 2))
    factors, pivots, _ = dgetrf(tractions)
    if dgecon(factors, np.abs(tractions).sum(axis=0).max(initial=0.0))[0] > HELD:
        found = dgetrs(factors, pivots, jumps.T, trans=1)[0].T
        return (found if np.isfinite(found).all() else None), False
    values = np.linalg.svd(tractions, compute_uv=False)
    sprung = bool(values[-1] <= FREE * values[0])
    if sprung:
        tractions = tractions - SPRING * values[0] / np.linalg.norm(jumps, 2) * jumps
    try:
        found = jumps @ np.linalg.inv(tractions)
    except np.linalg.LinAlgError:
        return None, sprung
    return (found if np.isfinite(found).all() else None), sprung


def pivot_pairs(
    pairs: PairProblem, compliance: Real, detached: Bool, near: ModeState | None = None
) -> ModeState | None:
    """The modes of the complementarity problem in which some pairs are detached; None where it fails (theory, 56).

    near (s,): modes that may be near to them, from which fewer pivots lead there.
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
    matrix[rough, last] = -pairs.climb[closed[rough]]
    slip_at_rest = jump[count + closed[rough]]
    constant = np.concatenate([jump[closed], -slip_at_rest, slip_at_rest, pairs.adhesion[closed[rough]]])
    # Many bounds are zero at rest: unequal small numbers keep the pivoting from going round among them.
    constant += PERTURBATION * np.abs(constant).max(initial=0.0) * (1 + np.arange(len(constant)) * 0.6180339887 % 1)
    start = np.zeros(len(constant), dtype=bool) if near is None else _find_basis(pairs, near, closed, rough)
    found = pivot_from(matrix, constant, start)
    pairs.effort.take(4.0 * found.pivots * len(constant) ** 2 + 2.0 * start.sum() * len(constant) ** 2)
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


def _find_basis(pairs: PairProblem, modes: ModeState, closed: Integer, rough: Integer) -> Bool:
    """Which unknowns of the complementarity problem of the closed pairs are basic in some modes (n + 3 r,).

    Pairs that part slide without N. The sense of what sticks is that of its traction, of what parts that of its slip.
    """
    d = solve_in_modes(pairs, modes)
    along, moved = (np.zeros((2, len(modes.mode))) if d is None else pairs.constant[[1, 3]] + pairs.change[[1, 3]] @ d)
    sense = np.where(modes.mode == STICK, along, np.where(modes.mode == OPEN, moved, modes.sign))[closed[rough]]
    slides = modes.mode[closed[rough]] != STICK
    return np.concatenate([modes.mode[closed] != OPEN, sense >= 0, sense < 0, slides])


def solve_in_modes(pairs: PairProblem, modes: ModeState) -> Real | None:
    """d (2 s,) for which every pair fulfils the equations of its mode; None if there is none, or not one alone.

    Rounding alone tells apart the solutions of equations that are all but singular: they have none either.
    """
    found = factorise_modes(pairs, modes)
    return None if found is None else found.d


@dataclass(frozen=True)
class Factors:
    """LU factors (n, n) of the equations of all pairs in some modes, their row exchanges (n,), right side (n,),
    solution d (n,), and the reciprocal of their condition."""

    lu: Real
    exchanges: Integer
    right: Real
    d: Real
    condition: float


def factorise_modes(pairs: PairProblem, modes: ModeState) -> Factors | None:
    """The equations of some modes, factorised and solved; None as in solve_in_modes."""
    matrix, right = pose_modes(pairs, modes, slice(None))
    if not len(right):
        return Factors(matrix, np.zeros(0, dtype=np.int32), right, right, 1.0)
    if not (np.isfinite(matrix).all() and np.isfinite(right).all()):
        return None
    pairs.effort.take(2.0 / 3.0 * len(right) ** 3)
    found = dgesvx(matrix, right[:, None], fact="N")
    d, condition = np.asarray(found[7])[:, 0], float(found[8])
    if not (condition >= REGULAR and np.isfinite(d).all()):
        return None
    return Factors(np.asarray(found[1]), np.asarray(found[2]), right, d, condition)


def pose_modes(pairs: PairProblem, modes: ModeState, which: Integer | slice) -> tuple[Real, Real]:
    """The equations of some pairs (k,) in their modes: rows (2 k, 2 s), those of the normal direction first, and right
    sides (2 k,); each divided by the largest of its row, no numbers where all of it is zero."""
    mode, sign = modes.mode[which], modes.sign[which]
    constant, change = pairs.constant[:, which], pairs.change[:, which]
    friction, adhesion = (np.where(pairs.rough, values, 0.0)[which] for values in (pairs.friction, pairs.adhesion))
    is_open, slides, sticks = mode == OPEN, mode == SLIP, mode == STICK
    by_normal = -sign * friction
    bound = sign * (adhesion + friction * np.where(pairs.rough, pairs.limit, 0.0)[which])
    climb = pairs.sign[which] * np.where(slides & pairs.rough[which], pairs.climb[which], 0.0)
    lifted = change[2] - climb[:, None] * change[3]
    first = np.where(is_open[:, None], change[0], lifted)
    on_seat = climb * constant[3] - constant[2]
    given = np.where(is_open, (pairs.limit - pairs.tension)[which] - constant[0], on_seat)
    tangential = change[1] - np.where(slides, by_normal, 0.0)[:, None] * change[0]
    rubs = np.where(slides, bound + by_normal * constant[0], 0.0) - constant[1]
    second = np.where(sticks[:, None], change[3], tangential)
    matrix = np.concatenate([first, second])
    right = np.concatenate([given, np.where(sticks, -constant[3], rubs)])
    # Rows are of two kinds, tractions and jumps; a column of nothing but rounding must stay small.
    size = np.abs(matrix).max(axis=1, initial=0.0)
    size = np.where(size > 0, size, np.nan)
    return matrix / size[:, None], right / size
