"""Conditions on the outer curves and the history of their values, and the laws of interfaces and cracks."""

from __future__ import annotations

from collections.abc import Collection, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from pbem.description.case import Case
from pbem.description.effects import TIMED
from pbem.description.schema import LawTable, StageConditionTable, StageInterfaceTable
from pbem.description.varying import VaryingTable
from pbem.errors import Fault, KeyPath
from pbem.model.construction import list_bared, list_removed, read_construction
from pbem.model.given import read_value
from pbem.model.in_situ import LinearStress
from pbem.model.law import read_law
from pbem.model.model import Condition, Contact, Interface, Law, Quantity, Stage, list_timed
from pbem.model.piece_faults import read_interface_law
from pbem.model.point_loads import read_point_forces
from pbem.model.point_supports import read_support_values
from pbem.model.rigid_body import RigidLoading, read_rigid_loading
from pbem.model.roles import Roles, unknown_name
from pbem.model.shaping import find_corners
from pbem.model.stress_fields import StressFields, read_stress_fields
from pbem.model.swelling import read_swellings
from pbem.model.varying import Value, Varying, negate
from pbem.model.walls import Wall, check_wall, update_wall

# Key to frame, direction and quantity.
_KEYS: Mapping[str, tuple[Literal["global", "local"], int, Quantity]] = {
    "ux": ("global", 0, "displacement"), "uy": ("global", 1, "displacement"),
    "tx": ("global", 0, "traction"), "ty": ("global", 1, "traction"),
    "un": ("local", 0, "displacement"), "us": ("local", 1, "displacement"),
    "tn": ("local", 0, "traction"), "ts": ("local", 1, "traction"),
}


ENDS = ("end_n", "end_s")


@dataclass(frozen=True)
class Loading:
    """What acts on a model; the mappings are in the order of the file (interfaces before cracks)."""

    conditions: Mapping[str, Condition]
    interfaces: Mapping[str, Interface]
    contacts: Mapping[str, Contact]
    stages: tuple[Stage, ...]
    rigid: RigidLoading
    initial_stress: Mapping[str, LinearStress]
    rest_gravity: complex
    faults: tuple[Fault, ...]


def read_loading(case: Case, roles: Roles) -> Loading:
    """Conditions of every outer curve, laws of every interface and crack, and complete values for every stage."""
    faults = [*_check_names(case, roles), *_check_values(case)]
    conditions = {}
    for name in (name for name in roles.outer if name not in roles.in_contact):
        condition, wrong = _find_condition(case, name)
        conditions[name] = condition
        faults += wrong
    rigid = read_rigid_loading(case, roles)
    faults += rigid.faults
    for body in rigid.bodies.values():
        for name in body.curves:
            if name in conditions:
                conditions[name] = Condition(name, "global", ("displacement", "displacement"))
    interfaces: dict[str, Interface] = {}
    laws: dict[Hashable, Law] = {}
    none = LawTable()
    generated = {name for group in case.groups for name in group.members}
    for name in [*roles.shared, *roles.cracks]:
        sides = roles.shared[name] if name in roles.shared else (roles.cracks[name], None)
        default: Literal["bonded", "coulomb"] = "bonded" if name in roles.shared else "coulomb"
        table = case.interfaces.get(name, none)
        # One table may stand for many interfaces that were generated together, and its faults for theirs.
        key = (id(table), default) if name in generated else name
        if key not in laws:
            laws[key], wrong = read_interface_law(case, name, table, default)
            faults += wrong
        interfaces[name] = Interface(name, sides[0], sides[1], laws[key])
    contacts: dict[str, Contact] = {}
    for name, (first, second) in roles.contacts.items():
        law, wrong = read_law(case, ("contacts", name), case.contacts[name], "coulomb")
        contacts[name] = Contact(name, first, second, law)
        faults += wrong
    joints = {name: each.law for name, each in interfaces.items()} | {name: each.law for name, each in contacts.items()}
    stress_fields = read_stress_fields(case)
    faults += stress_fields.faults
    swellings = read_swellings(case, find_corners(case))
    faults += swellings.faults
    point_forces, wrong = read_point_forces(case)
    faults += wrong
    support_values, wrong = read_support_values(case)
    faults += wrong
    construction, wrong = read_construction(case, roles, joints)
    faults += wrong
    stages = tuple(
        replace(stage, swelling=swelling, point_forces=forces, support_values=shifts, remote_growth=growth,
                rigid={name: values[name] for name in rigid.bodies}, construction=there)
        for stage, swelling, forces, shifts, growth, values, there in zip(
            _find_stages(case, conditions, joints, stress_fields), swellings.stages, point_forces,
            support_values, stress_fields.remote, rigid.stages, construction, strict=True,
        )
    )
    faults += _check_durations(case, joints, stages, rigid)
    return Loading(conditions, interfaces, contacts, stages, rigid, stress_fields.initial_stress,
                   stress_fields.rest_gravity, tuple(faults))


def _given(table: StageConditionTable) -> dict[str, Value]:
    """Values by the keys ux ... ts, with pressure written out; 0 for what is no expression."""
    values = {key: _read(getattr(table, key)) for key in _KEYS if getattr(table, key) is not None}
    if table.pressure is not None:
        values |= {"tn": negate(_read(table.pressure)), "ts": 0.0}
    return values


def _read(given: float | VaryingTable) -> Value:
    return read_value((), given, timed=True)[0] or 0.0


def _check_values(case: Case) -> Iterator[Fault]:
    """Expressions of conditions and pressures that are none."""
    tables: list[tuple[KeyPath, StageConditionTable | StageInterfaceTable | LawTable]] = []
    tables += [(("boundary", name), table) for name, table in case.boundary.items()]
    tables += [(("interfaces", name), table) for name, table in case.interfaces.items()]
    tables += [(("contacts", name), table) for name, table in case.contacts.items()]
    for number, stage in enumerate(case.stages):
        for key in ("boundary", "interfaces", "contacts"):
            tables += [(("stages", number, key, name), table) for name, table in getattr(stage, key).items()]
    for name in case.boundary:
        yield from read_springs(case, name)[1]
    for loc, table in tables:
        for key in (*_KEYS, "pressure", *ENDS):
            yield from read_value((*loc, key), getattr(table, key, None), timed=True)[1]


def _tables(case: Case, curve: str) -> list[tuple[KeyPath, StageConditionTable]]:
    """The condition tables of a curve in the order in which they act: base, then stages."""
    tables: list[tuple[KeyPath, StageConditionTable]] = []
    if curve in case.boundary:
        tables.append((("boundary", curve), case.boundary[curve]))
    for number, stage in enumerate(case.stages):
        if curve in stage.boundary:
            tables.append((("stages", number, "boundary", curve), stage.boundary[curve]))
    return tables


def _check_names(case: Case, roles: Roles) -> list[Fault]:
    faults: list[Fault] = []
    two_sided = [*roles.shared, *roles.cracks]
    places: list[tuple[KeyPath, Iterable[str]]] = [((), case.boundary)]
    places += [(("stages", number), stage.boundary) for number, stage in enumerate(case.stages)]
    for prefix, names in places:
        for name in names:
            loc = (*prefix, "boundary", name)
            if name in two_sided and prefix and name in list_bared(roles, list_removed(case, int(prefix[1]))):
                faults += check_wall(case, int(prefix[1]), name)
            elif name in two_sided:
                kind = "an interface" if name in roles.shared else "a crack"
                expected = f"conditions on outer curves only; what {kind} does belongs in [interfaces.{name}]"
                faults.append(Fault.at(loc, f"conditions on '{name}', {kind}", expected))
            elif roles.outer.get(name) in case.tools:
                tool = roles.outer[name]
                keys = "fx, fy, moment, ux, uy or rotation in "
                place = f"[stages.tools.{tool}]" if prefix else f"[tools.{tool}]"
                faults.append(Fault.at(loc, f"conditions on '{name}', a rigid tool", keys + place))
            elif name in roles.in_contact:
                expected = f"conditions on other curves: what it does belongs in [contacts.{roles.in_contact[name]}]"
                found = f"conditions on '{name}', which is in contact '{roles.in_contact[name]}'"
                faults.append(Fault.at(loc, found, expected))
            elif name not in case.curves:
                faults.append(unknown_name(loc, name, "curve", roles.outer or case.curves))
    places = [((), case.interfaces)]
    places += [(("stages", number), stage.interfaces) for number, stage in enumerate(case.stages)]
    for prefix, names in places:
        for name in names:
            loc = (*prefix, "interfaces", name)
            if name in roles.outer:
                kind = ("a rigid tool" if roles.outer[name] in case.tools else
                        f"an outer curve of region '{roles.outer[name]}'")
                expected = "a curve shared by two regions, or a crack"
                if name in roles.in_contact:
                    expected += f"; what '{name}' does belongs in [contacts.{roles.in_contact[name]}]"
                faults.append(Fault.at(loc, f"a law for '{name}', {kind}", expected))
            elif name not in case.curves:
                faults.append(unknown_name(loc, name, "interface or crack", two_sided))
    for number, stage in enumerate(case.stages):
        faults += [
            unknown_name(("stages", number, "contacts", name), name, "contact", case.contacts)
            for name in stage.contacts if name not in case.contacts
        ]
    return faults


def _find_condition(case: Case, curve: str) -> tuple[Condition, list[Fault]]:
    """The kinds of known quantities, which must be the same in the base table and in all stages."""
    faults: list[Fault] = []
    frame: Literal["global", "local"] | None = None
    known: list[Quantity | None] = [None, None]
    where = ["", ""]
    stiffness = read_springs(case, curve)[0]
    sprung = any(stiffness)
    for direction in (0, 1):
        if stiffness[direction]:
            known[direction], where[direction] = "traction", "spring"
    for order, (loc, table) in enumerate(_tables(case, curve)):
        for key in _given(table):
            key_frame, direction, quantity = _KEYS[key]
            written = (*loc, "pressure" if table.pressure is not None and key in ("tn", "ts") else key)
            if frame not in (None, key_frame):
                expected = f"{frame} components as before: one kind of components on a curve in all stages"
                fault = Fault.at(written, f"'{written[-1]}', a {key_frame} component", expected)
                faults.append(fault)
                break
            frame = key_frame
            if sprung and key_frame == "global" and quantity == "displacement":
                expected = "tractions beside a spring, or un or us where it has no stiffness"
                faults.append(Fault.at(written, f"'{key}' beside a spring", expected))
                continue
            if known[direction] not in (None, quantity):
                found = f"'{written[-1]}' where '{where[direction]}' was given before"
                expected = f"the same kind of condition in all stages ({known[direction]} in this direction)"
                faults.append(Fault.at(written, found, expected))
            elif quantity == "displacement" and known[direction] is None and _is_late(case, curve, order):
                found = f"'{key}' for the first time in a later stage"
                expected = f"its value in [boundary.{curve}] or in the first stage too (0 holds the curve)"
                faults.append(Fault.at(written, found, expected))
            if known[direction] is None:
                known[direction], where[direction] = quantity, str(written[-1])
    faults += _check_ends(case, curve, stiffness)
    in_axes = sprung and frame == "global"
    return Condition(
        curve, "local" if sprung else frame or "global", (known[0] or "traction", known[1] or "traction"), stiffness,
        in_axes,
    ), faults


def read_springs(case: Case, curve: str) -> tuple[tuple[Value, Value], list[Fault]]:
    """The stiffness along the normal and along the curve, with faults of expressions that are none."""
    spring = case.boundary[curve].spring if curve in case.boundary else None
    if spring is None:
        return (0.0, 0.0), []
    found = [read_value(("boundary", curve, "spring", key), getattr(spring, key), timed=False) for key in ("kn", "ks")]
    return (found[0][0] or 0.0, found[1][0] or 0.0), [fault for _, faults in found for fault in faults]


def _check_ends(case: Case, curve: str, stiffness: tuple[Value, Value]) -> Iterator[Fault]:
    """Far ends are those of springs."""
    for loc, table in _tables(case, curve):
        for key, spring, each in (("end_n", "kn", stiffness[0]), ("end_s", "ks", stiffness[1])):
            if getattr(table, key) is not None and not each:
                yield Fault.at((*loc, key), f"'{key}' without a spring", f"spring.{spring} in [boundary.{curve}]")


def list_held(conditions: Mapping[str, Condition]) -> dict[str, tuple[str, ...]]:
    """The curves on which displacements are prescribed, with the keys that do."""
    held = {
        name: tuple(key for key, (frame, direction, quantity) in _KEYS.items() if quantity == "displacement"
                    and frame == condition.frame and condition.known[direction] == quantity)
        for name, condition in conditions.items()
    }
    return {name: keys for name, keys in held.items() if keys}


def _is_late(case: Case, curve: str, order: int) -> bool:
    """The curve's table number `order` is neither the base nor that of the first stage."""
    loc = _tables(case, curve)[order][0]
    return loc[0] == "stages" and loc[1] != 0


def _find_stages(
    case: Case, conditions: Mapping[str, Condition], joints: Collection[str], stress_fields: StressFields
) -> tuple[Stage, ...]:
    """joints: names of the interfaces, cracks and contacts."""
    values: dict[str, list[Value]] = {name: [0.0, 0.0] for name in conditions}
    pressure: dict[str, Value] = {name: 0.0 for name in joints}
    laws = {**case.contacts, **case.interfaces}
    ends: dict[str, list[Value]] = {name: [0.0, 0.0] for name in conditions if _has_ends(case, name)}
    for name in conditions:
        _update(values[name], case.boundary.get(name))
        _move_ends(ends, name, case.boundary.get(name))
    for name in joints:
        if name in laws:
            pressure[name] = _read(laws[name].pressure)
    fields = [(stress.value, gravity)
              for stress, gravity in zip(stress_fields.remote, stress_fields.gravity, strict=True)]
    if not case.stages:
        return (Stage("load", case.analysis.steps, _freeze(values), dict(pressure), *fields[0], ends=_freeze(ends)),)
    stages = []
    walls: dict[str, Wall] = {}
    for number, stage in enumerate(case.stages):
        for name in conditions:
            _update(values[name], stage.boundary.get(name))
            _move_ends(ends, name, stage.boundary.get(name))
        bared = {name: table for name, table in stage.boundary.items() if name in joints}
        changes: dict[str, StageInterfaceTable | StageConditionTable] = {**stage.contacts, **stage.interfaces, **bared}
        for name in joints:
            if name in changes:
                pressure[name] = _read(changes[name].pressure or 0.0)
        for name, table in bared.items():
            update_wall(walls, name, table)
        name = stage.name or f"stage {number + 1}"
        duration = stage.duration or 0.0
        stages.append(Stage(name, stage.steps, _freeze(values), dict(pressure), *fields[number], duration=duration,
                            ends=_freeze(ends), walls=dict(walls)))
    return tuple(stages)


def _check_durations(
    case: Case, laws: Mapping[str, Law], stages: Sequence[Stage], rigid: RigidLoading
) -> Iterator[Fault]:
    """Laws that depend on time need the duration of every stage, loads that do need that of all stages or of none;
    without either, durations have no effect."""
    timed = next(((name, law.kind) for name, law in laws.items() if law.kind in TIMED), None)
    resultants = [value for stage in rigid.stages for values in stage.values() for value in values]
    loads = any(list_timed(stage) for stage in stages) or any(
        isinstance(value, Varying) and value.timed for value in resultants)
    if timed is not None and not case.stages:
        found = f"no [[stages]], but the law of '{timed[0]}' is {timed[1]}, which depends on time"
        yield Fault.at(("analysis", "steps"), found, "[[stages]] with the duration of each")
    some = any(stage.duration is not None for stage in case.stages)
    for number, stage in enumerate(case.stages):
        if timed is not None and stage.duration is None:
            found = f"a stage without duration, but the law of '{timed[0]}' is {timed[1]}, which depends on time"
            yield Fault.at(("stages", number), found, "duration = the time that the stage takes")
        elif loads and some and stage.duration is None:
            found = "a stage without duration, but others have one and a load depends on the time t"
            yield Fault.at(("stages", number), found, "the duration of every stage, or of none: each takes 1 then")
        elif timed is None and not loads and stage.duration is not None:
            expected = (f"a law ({', '.join(TIMED)}) or a load that depends on time somewhere, or no such key: it has "
                        "no effect")
            yield Fault.at(("stages", number, "duration"), f"duration = {stage.duration:g}", expected)


def _update(values: list[Value], table: StageConditionTable | None) -> None:
    for key, value in _given(table).items() if table else ():
        values[_KEYS[key][1]] = value


def _has_ends(case: Case, curve: str) -> bool:
    return any(getattr(table, key) is not None for _, table in _tables(case, curve) for key in ENDS)


def _move_ends(ends: Mapping[str, list[Value]], curve: str, table: StageConditionTable | None) -> None:
    for direction, key in enumerate(ENDS):
        if table is not None and getattr(table, key) is not None:
            ends[curve][direction] = _read(getattr(table, key))


def _freeze(values: Mapping[str, list[Value]]) -> dict[str, tuple[Value, Value]]:
    return {curve: (pair[0], pair[1]) for curve, pair in values.items()}
