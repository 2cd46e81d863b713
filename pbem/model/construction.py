"""Construction in stages: faces that are joined, opened or left to their law, and regions that are taken away."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace

from pbem.description.case import Case
from pbem.description.schema import StageTable
from pbem.errors import Fault, KeyPath
from pbem.model.model import Construction, Contact, Hold, Interface, Law, Model, Stage
from pbem.model.point_loads import PointLoad
from pbem.model.point_supports import PointSupport
from pbem.model.roles import Roles, describe_name, unknown_name

# What a stage says of interfaces, cracks and contacts, with what they are from then on (None: what their law says).
KEYS: Mapping[str, Hold | None] = {"open": "open", "close": "closed", "release": None}

NO_VALUES = "no values for a removed object, in the stage that removes it and in later ones"


def read_construction(
    case: Case, roles: Roles, laws: Mapping[str, Law]
) -> tuple[tuple[Construction, ...], list[Fault]]:
    """What there is in every stage; what a stage does not name stays as it was. laws: of interfaces and contacts."""
    joints: dict[str, Hold] = {}
    removed: list[str] = []
    stages: list[Construction] = []
    faults: list[Fault] = []
    for number, table in enumerate(case.stages):
        faults += _check_removed(case, roles, number, table, removed)
        removed += [name for name in dict.fromkeys(table.remove) if name in case.regions and name not in removed]
        around = {name for name in laws if not set(removed).isdisjoint(_list_sides(roles, name))}
        faults += _check_joints(case, roles, number, table, joints, laws, around)
        faults += _check_gone(roles, number, table, removed)
        for key, hold in KEYS.items():
            for name in (name for name in getattr(table, key) if name in laws):
                joints.pop(name, None)
                if hold is not None:
                    joints[name] = hold
        # Cracks of a region that is gone have nothing to do any more.
        joints |= {name: "closed" if name in roles.cracks else "open" for name in laws if name in around}
        stages.append(Construction(dict(joints), tuple(name for name in case.regions if name in removed)))
    return tuple(stages) or (Construction(),), faults


def _list_sides(roles: Roles, name: str) -> tuple[str, ...]:
    """The regions on the two sides of an interface, a crack or a contact."""
    if name in roles.contacts:
        return tuple(roles.outer[curve] for curve in roles.contacts[name])
    return roles.shared[name] if name in roles.shared else (roles.cracks[name],)


def list_bared(roles: Roles, removed: Collection[str]) -> list[str]:
    """Interfaces of two regions of which one is gone and the other is not."""
    return [name for name, sides in roles.shared.items() if (sides[0] in removed) != (sides[1] in removed)]


def list_removed(case: Case, stage: int) -> set[str]:
    """The regions that are gone by a stage."""
    return {name for table in case.stages[: stage + 1] for name in table.remove}


# How to take away what is no region, by what it is.
INSTEAD: Mapping[str, str] = {
    "a rigid tool": "a region; for a tool without load, name its contact in 'open'",
    "an interface": "a region; faces without traction are named in 'open'",
    "a crack": "a region; faces without traction are named in 'open'",
    "a contact": "a region; faces without traction are named in 'open'",
    "a point load": "a region; a load ends with fx = 0 and fy = 0 in a stage",
}  # fmt: skip


def _check_removed(
    case: Case, roles: Roles, number: int, table: StageTable, before: Sequence[str]
) -> Iterator[Fault]:
    loc: KeyPath = ("stages", number, "remove")
    seen: list[str] = []
    for name in table.remove:
        if name not in case.regions:
            kind = describe_name(case, roles, name)
            yield (Fault.at(loc, f"'{name}', {kind}", INSTEAD.get(kind, "a region")) if kind
                   else unknown_name(loc, name, "region", case.regions))
        elif name in before or name in seen:
            yield Fault.at(loc, f"region '{name}', which is gone already", "each region once")
        elif case.regions[name].infinite:
            yield Fault.at(loc, f"the infinite region '{name}'", "a finite region")
        seen.append(name)
    if seen and {*before, *seen} >= set(case.regions):
        yield Fault.at(loc, "all regions", "at least one region that stays")


def _check_gone(roles: Roles, number: int, table: StageTable, removed: Collection[str]) -> Iterator[Fault]:
    """Values in a stage for what is gone with a region by then, which have no effect."""
    gone: dict[KeyPath, tuple[str, str]] = {
        ("boundary", name): (f"conditions on '{name}'", roles.outer[name])
        for name in table.boundary if roles.outer.get(name) in removed
    }  # fmt: skip
    gone |= {("temperature", name): ("a temperature", name) for name in table.temperature if name in removed}
    gone |= {("eigenstrain", name): ("an eigenstrain", name) for name in table.eigenstrain if name in removed}
    for loc, (found, region) in gone.items():
        yield Fault.at(("stages", number, *loc), f"{found} of region '{region}', which is gone", NO_VALUES)
    for name in table.interfaces:
        sides = roles.shared[name] if name in roles.shared else [roles.cracks.get(name)]
        if not set(removed).isdisjoint(sides):
            expected = (f"its pressure in [stages.boundary.{name}]" if name in list_bared(roles, removed) else
                        NO_VALUES)
            yield Fault.at(("stages", number, "interfaces", name), f"a pressure of '{name}', where a region is gone",
                           expected)


def check_gone_points(
    case: Case, loads: Mapping[str, PointLoad], supports: Mapping[str, PointSupport]
) -> Iterator[Fault]:
    """The same of points, which belong to regions by where they lie."""
    owners = {("point_loads", name): ("a point load", {load.region}) for name, load in loads.items()}
    owners |= {("point_supports", name): ("a point support", {region for region, _ in support.owners})
               for name, support in supports.items()}
    for number, stage in enumerate(case.stages):
        removed = list_removed(case, number)
        given = [(key, name) for key in ("point_loads", "point_supports") for name in getattr(stage, key)]
        for loc in given:
            kind, regions = owners.get(loc, ("", set()))
            if regions and regions <= removed:
                yield Fault.at(("stages", number, *loc), f"{kind} on region '{min(regions)}', which is gone", NO_VALUES)


def _check_joints(
    case: Case, roles: Roles, number: int, table: StageTable, before: Mapping[str, Hold], laws: Mapping[str, Law],
    gone: Collection[str],
) -> Iterator[Fault]:
    """Names that are none, are named twice, would change nothing, or are those of faces of a region that is gone."""
    told: dict[str, str] = {}
    for key, hold in KEYS.items():
        loc: KeyPath = ("stages", number, key)
        for name in getattr(table, key):
            if name not in laws:
                kind, expected = describe_name(case, roles, name), "an interface of two regions, a crack or a contact"
                if kind:
                    if name in roles.in_contact:
                        expected += f": '{name}' is in contact '{roles.in_contact[name]}'"
                    if kind == "a region" and key == "open":
                        expected += "; 'remove' takes regions away"
                    yield Fault.at(loc, f"'{name}', {kind}", expected)
                else:
                    yield unknown_name(loc, name, "interface, crack or contact", laws)
                continue
            now, kind = before.get(name), laws[name].kind
            if name in told:
                yield Fault.at(loc, f"'{name}', which is in '{told[name]}' of this stage too", "each name once")
            elif name in gone:
                expected = "no such name: its faces are free of traction once a region beside it is gone"
                yield Fault.at(loc, f"'{name}', a curve of a region that is gone", expected)
            elif hold is not None and now == hold:
                yield Fault.at(loc, f"'{name}', which is {now} already", "the name of faces that change")
            elif hold == "closed" and now is None and kind == "bonded":
                yield Fault.at(loc, f"'{name}', which is bonded by its law", "faces that can move against each other")
            elif hold == "open" and now is None and kind == "open":
                yield Fault.at(loc, f"'{name}', which never touches by its law", "faces that carry something")
            elif hold is None and now is None:
                expected = "the name of faces that an earlier stage has closed or opened"
                yield Fault.at(loc, f"'{name}', which follows its law already", expected)
            told[name] = key


def arrange_model(model: Model, stage: int) -> Model:
    """The model as it is in a stage: regions that are gone are marked, and faces have the law that holds them."""
    now = model.stages[stage].construction
    if not now.joints and not now.removed:
        return model
    every: dict[str, Interface | Contact] = {**model.interfaces, **model.contacts}
    laws = {name: _hold_law(every[name].law, hold) for name, hold in now.joints.items()}
    interfaces: dict[str, Interface] = {
        name: replace(each, law=laws.get(name, each.law)) for name, each in model.interfaces.items()
    }
    contacts: dict[str, Contact] = {
        name: replace(each, law=laws.get(name, each.law)) for name, each in model.contacts.items()
    }
    regions = tuple(replace(each, removed=each.name in now.removed) for each in model.regions)
    return replace(model, regions=regions, interfaces=interfaces, contacts=contacts)


def _hold_law(law: Law, hold: Hold) -> Law:
    if hold == "open":
        return Law("open")
    return Law("bonded", normal_stiffness=law.normal_stiffness, tangential_stiffness=law.tangential_stiffness)


def group_stages(model: Model) -> list[list[int]]:
    """The stages in turn, those after each other with the same construction together."""
    groups: list[list[int]] = []
    for number, stage in enumerate(model.stages):
        if groups and model.stages[groups[-1][0]].construction == stage.construction:
            groups[-1].append(number)
        else:
            groups.append([number])
    return groups


def list_opened(stages: Sequence[Stage], stage: int) -> list[str]:
    """Interfaces, cracks and contacts that open in a stage."""
    before: Mapping[str, Hold] = stages[stage - 1].construction.joints if stage > 0 else {}
    now = stages[stage].construction.joints
    return [name for name, hold in now.items() if hold == "open" and before.get(name) != "open"]


def describe_construction(model: Model, stage: int) -> list[str]:
    """What a stage takes away, opens, closes and leaves to its law, in words."""
    now = model.stages[stage].construction
    before = model.stages[stage - 1].construction if stage > 0 else Construction()
    gone = [name for name in now.removed if name not in before.removed]

    def stays(name: str) -> bool:
        joint = model.interfaces.get(name)
        return joint is None or joint.first not in now.removed or joint.second not in (None, *now.removed)

    changed = [name for name in {**before.joints, **now.joints} if before.joints.get(name) != now.joints.get(name)]
    groups = {"removes": gone}
    for verb, hold in (("opens", "open"), ("closes", "closed"), ("leaves to its law:", None)):
        groups[verb] = [name for name in changed if now.joints.get(name) == hold and stays(name)]
    return [f"{verb} {', '.join(names)}" for verb, names in groups.items() if names]
