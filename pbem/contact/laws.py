"""The laws of all contact pairs as arrays, their internal variables, and the states of the pairs.

A pair's state is (p_n, p_s, g_n, g_s): traction on the first side and jump, along n and s. A joint of finite stiffness
adds an elastic jump, compliance times traction, in front of its law; what is left of g_s is the plastic slip.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbem.arrays import Bool, Integer, Real
from pbem.contact.at_rest import settle_joints
from pbem.contact.cohesive import Cohesive
from pbem.contact.declaration import (
    BROKEN,
    COMMON,
    SLIP_PATH,
    FrictionLaw,
    InternalVariable,
    Slide,
    StepEnd,
    list_variables,
    take_values,
)
from pbem.contact.friction_bound import Strength
from pbem.contact.leaders import find_leaders
from pbem.contact.strength import choose_strength
from pbem.contact.surroundings import find_surroundings, stiffen
from pbem.formed import form_runs
from pbem.mesh.mesh import Mesh
from pbem.model.model import Contact, Interface, Law, Model
from pbem.model.varying import Places, Value, spread_values
from pbem.uniform import fold_uniform, repeat_value, share_equal

Modes = NDArray[np.int8]

STICK, SLIP, OPEN = np.int8(0), np.int8(1), np.int8(2)


@dataclass(frozen=True)
class StrengthGroup:
    """Pairs (k,) with the same friction law; every parameter is an array (k,)."""

    law: FrictionLaw
    pairs: Integer
    parameters: Mapping[str, Real]


@dataclass(frozen=True)
class PairLaws:
    """Laws of all m pairs, arrays (m,).

    strengths: the friction laws, each pair in one group. tensile_strength: stress; gap: initial opening, length.
    bonded pairs always stick without plastic slip; parted pairs ("open") never touch. brittle pairs lose cohesion and
    tensile strength for good. fluid_inside: the fluid pressure also acts in closed parts. compliance_n, compliance_s:
    length/stress of elastic joints, 0 if rigid. stiffness: trial stiffness r of the mode choice, stress/length;
    own_stiffness: of the surroundings of each pair alone.
    leader: the pair whose mode each pair takes; itself, but in the corner of a narrow wedge (see pbem.model.sliver).
    rest: the opening of pairs that stick and carry nothing, 0 but where a stage has closed faces that were apart.
    stiffening: 1/length, one over the largest closure of joints that stiffen as they close; 0 of linear ones.
    at_rest_n, at_rest_s: what joints add to opening (part of the gap) and slip under the in-situ stress at first.
    """

    strengths: tuple[StrengthGroup, ...]
    tensile_strength: Real
    gap: Real
    bonded: Bool
    parted: Bool
    brittle: Bool
    fluid_inside: Bool
    compliance_n: Real
    compliance_s: Real
    stiffness: Real
    own_stiffness: Real
    leader: Integer
    rest: Real = field(default_factory=lambda: np.zeros(0))
    stiffening: Real = field(default_factory=lambda: np.zeros(0))
    at_rest_n: Real = field(default_factory=lambda: np.zeros(0))
    at_rest_s: Real = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        for name in ("rest", "stiffening", "at_rest_n", "at_rest_s"):
            if not len(getattr(self, name)):
                object.__setattr__(self, name, repeat_value(0.0, len(self.gap)))

    @property
    def count(self) -> int:
        return len(self.gap)

    @property
    def follows(self) -> Bool:
        """Pairs (m,) that take the mode of another one."""
        return self.leader != np.arange(self.count)


@dataclass(frozen=True)
class ModeState:
    """Mode of every pair and, where it slips, the sign of its friction traction p_s (m,)."""

    mode: Modes
    sign: Real

    def fingerprint(self) -> bytes:
        """The same for the same modes and signs of slipping pairs."""
        return self.mode.tobytes() + np.where(self.mode == SLIP, self.sign, 0.0).tobytes()

    def put(self, at: Integer | Bool, own: ModeState) -> ModeState:
        """These modes, with those of some pairs at their places (s,)."""
        mode, sign = self.mode.copy(), self.sign.copy()
        mode[at], sign[at] = own.mode, own.sign
        return ModeState(mode, sign)


@dataclass(frozen=True)
class PairState:
    """Traction on the first side and jump of all pairs, (m,) each; g_n includes the initial gap."""

    p_n: Real
    p_s: Real
    g_n: Real
    g_s: Real

    def bear(self, carried: Real) -> PairState:
        """With tractions (m, 2) along n and s besides those of the laws."""
        return replace(self, p_n=self.p_n + carried[:, 0], p_s=self.p_s + carried[:, 1])

    def take(self, pairs: Integer) -> PairState:
        """The state of some pairs (k,)."""
        return PairState(*(values[pairs] for values in vars(self).values()))

    def choose(self, other: PairState, taken: Bool) -> PairState:
        """The state, with that of another one where pairs (m,) are taken from it."""
        return PairState(*(np.where(taken, vars(other)[name], own) for name, own in vars(self).items()))

    def approach(self, other: PairState, part: float) -> PairState:
        """The state at a part of the way to another one."""
        return PairState(*(own + part * (vars(other)[name] - own) for name, own in vars(self).items()))


@dataclass(frozen=True)
class Memory:
    """What the pairs bring into a step, (m,) each: of the last converged one, and how long this one takes.

    slip: plastic slip; internal: values of the internal variables that the laws declare, by their names;
    normal_traction: stress; opening: g_n. duration: of the step that is being solved, 0 where there is no time.
    """

    modes: ModeState
    slip: Real
    internal: Mapping[str, NDArray[Any]]
    normal_traction: Real
    opening: Real
    duration: float = 0.0

    @property
    def path(self) -> Real:
        """Accumulated length of the plastic slip."""
        return self.internal[SLIP_PATH.name]

    @property
    def broken(self) -> Bool:
        """Brittle bonds that are lost."""
        return self.internal[BROKEN.name]

    def lose(self, broken: Bool) -> Memory:
        """With these brittle bonds (m,) lost, and no others."""
        return replace(self, internal={**self.internal, BROKEN.name: broken})

    def look_ahead(self, ahead: Real) -> Slide:
        """The step, so much slip (m,) >= 0 after its beginning."""
        return Slide(ahead, self.internal, self.duration)


# A tenth of a modulus per half-length: a stiff trial (8 moduli per half-length) cycles in fields of many cracks.
SOFTNESS = 0.2


def find_joint(model: Model, name: str) -> Interface | Contact:
    """The interface, crack or contact of a name of Mesh.interface_names."""
    return model.interfaces[name] if name in model.interfaces else model.contacts[name]


def collect_laws(model: Model, mesh: Mesh) -> PairLaws:
    """Laws of every pair, and a soft trial stiffness from modulus and length (theory, 52)."""
    pairs = mesh.pairs
    joints = [find_joint(model, name) for name in mesh.interface_names]
    laws = [joint.law for joint in joints]
    around = find_surroundings(mesh, [region.material.plane_modulus for region in model.regions])
    stiffness, own_stiffness = stiffen(around, SOFTNESS)
    places = Places(pairs.position + model.origin, pairs.arc_length)

    def spread(values: list, kind: type = float) -> np.ndarray:
        return fold_uniform(np.array(values, dtype=kind)[pairs.interface])

    return _settle_joints(model, mesh, PairLaws(
        strengths=_group_strengths(laws, pairs.interface, model.law_texts, places),
        tensile_strength=fold_uniform(spread_values([law.tensile_strength for law in laws], pairs.interface, places)),
        gap=fold_uniform(pairs.distance + spread_values(
            [0.0 if law.kind == "bonded" else law.gap for law in laws], pairs.interface, places)),
        bonded=spread([law.kind == "bonded" for law in laws], bool),
        parted=spread([law.kind == "open" for law in laws], bool),
        brittle=spread([law.cohesion_lost for law in laws], bool),
        fluid_inside=spread([law.pressurised == "all" for law in laws], bool),
        compliance_n=spread([1 / law.normal_stiffness if law.normal_stiffness else 0.0 for law in laws]),
        compliance_s=spread([1 / law.tangential_stiffness if law.tangential_stiffness else 0.0 for law in laws]),
        stiffness=stiffness,
        own_stiffness=own_stiffness,
        leader=share_equal(find_leaders(mesh, model.ties, joints), pairs.first),
        stiffening=spread([
            1 / closure if isinstance(closure := law.parameters.get("closure"), float) else 0.0 for law in laws
        ]),
    ))


def _settle_joints(model: Model, mesh: Mesh, laws: PairLaws) -> PairLaws:
    """Laws with joints as they are under the in-situ stress; it is a load on cohesive ones, which count all jumps."""
    if not model.initial_stress or not (laws.compliance_n.any() or laws.compliance_s.any()):
        return laws
    held = (laws.gap <= 0) & ~laws.parted
    for group in (each for each in laws.strengths if isinstance(each.law, Cohesive)):
        held[group.pairs] = False
    limit = np.where(laws.bonded & ~laws.parted, np.inf, np.where(held, laws.tensile_strength, -np.inf))
    found = settle_joints(model, mesh, limit, (laws.compliance_n, laws.compliance_s), laws.stiffening)
    closed, slid = (each[laws.leader] for each in found)
    return replace(laws, gap=laws.gap + closed, at_rest_n=closed, at_rest_s=slid)


def _group_strengths(
    laws: list[Law], interface: Integer, texts: Mapping[str, str], places: Places
) -> tuple[StrengthGroup, ...]:
    functions: dict[str | None, FrictionLaw] = {}  # of each file, which is run once
    chosen: list[tuple[FrictionLaw, dict[str, Value]]] = []
    for law in laws:
        if law.kind == "custom" and law.file in functions:
            chosen.append((functions[law.file], dict(law.parameters)))
            continue
        chosen.append(choose_strength(law, texts.get(law.file or "")))
        if law.kind == "custom":
            functions[law.file] = chosen[-1][0]
    groups = []
    for function, names in {(function, tuple(parameters)): None for function, parameters in chosen}:
        members = np.array([(law, tuple(parameters)) == (function, names) for law, parameters in chosen])
        pairs = np.flatnonzero(members[interface])
        values = {
            name: spread_values([parameters.get(name, 0.0) for _, parameters in chosen], interface[pairs],
                                places.take(pairs))
            for name in names
        }
        if function not in functions.values():  # a law of the user's may write to what it is given
            values = {name: fold_uniform(each) for name, each in values.items()}
        groups.append(StrengthGroup(function, form_runs(pairs), values))
    return tuple(groups)


def find_effective(laws: PairLaws, p_n: Real, pressure: Real) -> Real:
    """Normal tractions (m,) less the pressure of the fluid that is inside of closed parts."""
    return np.asarray(p_n + np.where(laws.fluid_inside, pressure, 0.0))


def evaluate_strength(laws: PairLaws, p_n: Real, slide: Slide, pressure: Real) -> Strength:
    """Friction bound of all pairs and its derivatives; brittle pairs that are broken have no cohesion."""
    effective = find_effective(laws, p_n, pressure)
    result = Strength(np.zeros(laws.count), np.zeros(laws.count), np.zeros(laws.count))
    for group in laws.strengths:
        at = group.pairs
        if not len(at):  # of a contact without pairs; laws of one's own are not asked about none
            continue
        part = ask_law(group.law, effective[at], slide.take(at), group.parameters)
        result.bound[at], result.by_traction[at], result.by_slip[at] = part.bound, part.by_traction, part.by_slip
    return result


def ask_law(law: FrictionLaw, p_n: Real, slide: Slide, parameters: Mapping[str, Real]) -> Strength:
    """What it answers for pairs (k,), of which brittle ones that are broken have no cohesion; p_n: effective."""
    asked = dict(parameters)
    if "cohesion" in asked:
        asked["cohesion"] = np.where(slide.broken, 0.0, asked["cohesion"])
    return law.strength(p_n, slide, **asked)


def tensile_limit(laws: PairLaws, memory: Memory) -> Real:
    """Tensile strength (m,), none where a brittle bond is lost, and what is left of those that soften."""
    limit = np.where(memory.broken, 0.0, laws.tensile_strength)
    for group in laws.strengths:
        tension = group.law.find_tension(take_values(memory.internal, group.pairs), group.parameters)
        if tension is not None:
            limit[group.pairs] = tension
    return limit


def resists_slip(laws: PairLaws) -> Bool:
    """Whether a pair's law has any friction or cohesion, (m,); pairs without slip freely in both directions."""
    resists = np.ones(laws.count, dtype=bool)
    for group in laws.strengths:
        resists[group.pairs] = group.law.resists(group.parameters)
    return resists


def find_linear(laws: PairLaws) -> Bool:
    """The pairs (m,) whose friction bound is linear in the normal traction alone, as Coulomb's."""
    linear = np.zeros(laws.count, dtype=bool)
    for group in laws.strengths:
        linear[group.pairs] = group.law.linear
    return linear


def find_pivoting(laws: PairLaws) -> Bool:
    """The pairs (m,) whose contact is a complementarity problem, step by step."""
    own = [group.pairs for group in laws.strengths if group.law.pivots]
    return np.isin(np.arange(laws.count), np.concatenate(own) if own else [])


def find_changing(laws: PairLaws) -> Bool:
    """The pairs (m,) whose mode can change by itself: not those that are bonded, that never touch, or that follow."""
    return np.asarray(~(laws.bonded | laws.parted | laws.follows))


def find_creeping(laws: PairLaws) -> Bool:
    """The pairs (m,) whose friction rises with the rate of slip from nothing: they never stick, and hold as they creep.

    Not those that never slip nor touch.
    """
    creeping = np.zeros(laws.count, dtype=bool)
    for group in laws.strengths:
        creeping[group.pairs] = group.law.creeps
    return creeping & ~laws.bonded & ~laws.parted


def stick_creeping(laws: PairLaws, modes: ModeState) -> ModeState:
    """The modes, with creeping pairs sticking: as far as rigid motions go, they hold as much."""
    creeping = find_creeping(laws) & (modes.mode == SLIP)
    return ModeState(np.where(creeping, STICK, modes.mode).astype(np.int8), modes.sign) if creeping.any() else modes


def start_memory(laws: PairLaws) -> Memory:
    """Before any load closed pairs stick, or slip if nothing resists or they creep; pairs with a gap are open."""
    is_open = laws.parted | (laws.gap > 0) & (laws.at_rest_n <= 0) & ~laws.bonded  # joints may bear tension at rest
    sticks = resists_slip(laws) & ~find_creeping(laws)
    closed = np.where(sticks | laws.bonded, STICK, SLIP)
    modes = ModeState(np.where(is_open, OPEN, closed).astype(np.int8)[laws.leader], repeat_value(1.0, laws.count))
    internal = lay_out(laws)
    for variable, at, parameters in _list_parts(laws):
        internal[variable.name][at] = variable.start(parameters)
    slip, none = fold_uniform(0.0 - laws.at_rest_s), repeat_value(0.0, laws.count)
    internal = {name: fold_uniform(values) for name, values in internal.items()}
    return Memory(modes, slip, internal, none, laws.gap).lose(fold_uniform(laws.brittle & is_open))


def lay_out(laws: PairLaws) -> dict[str, NDArray[Any]]:
    """Arrays (m,) for all internal variables, by their names; missing everywhere."""
    variables = list_variables(group.law for group in laws.strengths)
    return {each.name: np.full(laws.count, each.missing, dtype=each.kind) for each in variables}


def _list_parts(laws: PairLaws) -> Iterator[tuple[InternalVariable, Integer, Mapping[str, Real]]]:
    """Every internal variable with the pairs that have it, and the parameters of their law."""
    for variable in COMMON:
        yield variable, np.arange(laws.count), {}
    for group in laws.strengths:
        for variable in group.law.variables:
            yield variable, group.pairs, group.parameters


def follow_leaders(laws: PairLaws, modes: ModeState) -> ModeState:
    """The modes, with those of pairs in the corners of narrow wedges taken from their leaders."""
    return ModeState(modes.mode[laws.leader], modes.sign[laws.leader])


def plastic_slip(laws: PairLaws, state: PairState) -> Real:
    """Slip less the elastic part of the joint."""
    return state.g_s - laws.compliance_s * state.p_s


def slip_ahead(modes: ModeState, memory: Memory, slip: Real) -> Real:
    """Length of the present step's slip (m,) in the sense of the friction traction, 0 against it (theory, 50)."""
    ahead = np.where(modes.mode == SLIP, modes.sign * (slip - memory.slip), 0.0)
    return np.maximum(ahead, 0.0)


def commit(laws: PairLaws, memory: Memory, modes: ModeState, state: PairState, pressure: Real) -> Memory:
    """What is remembered of a converged step with a fluid pressure (m,) (theory, 50)."""
    slip = plastic_slip(laws, state)
    slipped = np.where(modes.mode == SLIP, np.abs(slip - memory.slip), 0.0)
    internal = {name: values.copy() for name, values in memory.internal.items()}
    for variable, at, parameters in _list_parts(laws):
        old = memory.internal[variable.name][at]
        internal[variable.name][at] = variable.advance(old, slipped[at], memory.duration, parameters)
    effective, slide = find_effective(laws, state.p_n, pressure), memory.look_ahead(slipped)
    jump, opened = np.stack([state.g_n - laws.compliance_n * state.p_n, slip], axis=1), modes.mode == OPEN
    for group in laws.strengths:
        at = group.pairs
        end = StepEnd(effective[at], slide.take(at), jump[at], opened[at])
        for name, values in group.law.advance(end, group.parameters).items():
            internal[name][at] = values
    return Memory(modes, slip, internal, state.p_n, state.g_n)
