"""What each curve is for, by the lists of the regions: outer boundary, interface of two regions, or crack."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from pbem.description.case import Case
from pbem.errors import Fault, KeyPath
from pbem.wording import list_names, suggest


@dataclass(frozen=True)
class Roles:
    """Every mapping is in the order of the curves in the file; curves with a faulty use are left out.

    outer: curve to its region; shared: curve to its two regions; cracks: curve to its region; contacts: name of a
    contact to its two curves, which are outer ones.
    """

    outer: Mapping[str, str]
    shared: Mapping[str, tuple[str, str]]
    cracks: Mapping[str, str]
    contacts: Mapping[str, tuple[str, str]]
    faults: tuple[Fault, ...]

    @property
    def in_contact(self) -> dict[str, str]:
        """Curve to the contact that it is part of."""
        return {curve: name for name, pair in self.contacts.items() for curve in pair}


def unknown_name(loc: KeyPath, name: str, what: str, known: Iterable[str]) -> Fault:
    """A fault for a name that nothing in the file defines, with the nearest one that is defined."""
    names = list(known)
    several = what.replace("interface, crack or", "interfaces, cracks and")
    expected = f"one of the {several}s: {list_names(names)}" if names else f"no name: the file has no such {what}"
    return Fault.at(loc, f"unknown {what} '{name}'{suggest(name, names)}", expected)


def describe_name(case: Case, roles: Roles, name: str) -> str:
    """What the file calls by a name that stands where another kind of thing is meant; "" if nothing."""
    kinds = {
        "a region": case.regions, "a rigid tool": case.tools, "an interface": roles.shared, "a crack": roles.cracks,
        "a contact": case.contacts, "a curve of one region": roles.outer, "a curve": case.curves,
        "a material": case.materials, "a point load": case.point_loads, "a point support": case.point_supports,
    }  # fmt: skip
    return next((kind for kind, names in kinds.items() if name in names), "")


def resolve_roles(case: Case) -> Roles:
    """Find the use of every curve; faults for unknown, repeated and unused names."""
    faults: list[Fault] = []
    bounds: dict[str, list[str]] = {name: [] for name in case.curves}
    inside: dict[str, list[str]] = {name: [] for name in case.curves}
    for region, table in case.regions.items():
        if table.material not in case.materials:
            loc = ("regions", region, "material")
            faults.append(unknown_name(loc, table.material, "material", case.materials))
        for key, names, uses in (("boundary", table.boundary, bounds), ("cracks", table.cracks, inside)):
            for index, name in enumerate(names):
                loc_of_name = ("regions", region, key, index)
                if name not in case.curves:
                    faults.append(unknown_name(loc_of_name, name, "curve", case.curves))
                elif region in uses[name]:
                    faults.append(Fault.at(loc_of_name, f"curve '{name}' a second time", "each curve once"))
                else:
                    uses[name].append(region)
    faults += _add_tools(case, bounds, inside)
    infinite = [region for region, table in case.regions.items() if table.infinite]
    for region in infinite[1:]:
        found = f"a second infinite region beside '{infinite[0]}'"
        faults.append(Fault.at(("regions", region, "infinite"), found, "at most one: they would overlap far away"))
    outer, shared, cracks = {}, {}, {}
    for name in case.curves:
        fault = _check_use(name, bounds[name], inside[name])
        if fault:
            faults.append(fault)
        elif inside[name]:
            cracks[name] = inside[name][0]
        elif len(bounds[name]) == 2:
            shared[name] = (bounds[name][0], bounds[name][1])
        else:
            outer[name] = bounds[name][0]
    kinds = {name: "an interface" for name in shared} | {name: "a crack" for name in cracks}
    contacts, wrong = _resolve_contacts(case, outer, kinds)
    return Roles(outer, shared, cracks, contacts, tuple(faults + wrong))


def _add_tools(case: Case, bounds: dict[str, list[str]], inside: Mapping[str, list[str]]) -> list[Fault]:
    """Enter the curves of rigid tools, which bound no region, as those of their tool."""
    faults = []
    for name, table in case.tools.items():
        if name in case.regions:
            faults.append(Fault.at(("tools", name), f"the name '{name}' of a region too", "a name of its own"))
            continue
        for index, curve in enumerate((name, *table.curves)):
            loc: KeyPath = ("tools", name, "curves", index - 1) if index else ("tools", name)
            if curve not in case.curves:
                faults.append(unknown_name(loc, curve, "curve", case.curves))
            elif bounds[curve] or inside[curve]:
                owners = list_names([f"'{each}'" for each in bounds[curve] + inside[curve]])
                found = f"curve '{curve}', which {owners} has"
                faults.append(Fault.at(loc, found, "a curve that bounds no region, of one tool"))
            else:
                bounds[curve].append(name)
    return faults


def _resolve_contacts(
    case: Case, outer: Mapping[str, str], kinds: Mapping[str, str]
) -> tuple[dict[str, tuple[str, str]], list[Fault]]:
    """kinds: what the curves are that are no outer ones; curves with faults of their own are in neither mapping."""
    faults: list[Fault] = []
    contacts: dict[str, tuple[str, str]] = {}
    taken: dict[str, str] = {}
    for name, table in case.contacts.items():
        if name in kinds:
            found = f"the name '{name}', which is that of {kinds[name]}"
            faults.append(Fault.at(("contacts", name), found, "a name of its own, under which results are stored"))
        if len(set(table.between)) == 2 and all(outer.get(curve) in case.tools for curve in table.between):
            faults.append(Fault.at(("contacts", name, "between"), "two rigid tools", "a tool and a curve of a body"))
            continue
        for index, curve in enumerate(table.between):
            loc = ("contacts", name, "between", index)
            if curve not in case.curves:
                faults.append(unknown_name(loc, curve, "curve", outer or case.curves))
            elif curve in kinds:
                expected = "curves that bound one region each; contact along a shared curve belongs in [interfaces]"
                faults.append(Fault.at(loc, f"curve '{curve}', {kinds[curve]}", expected))
            elif index and curve == table.between[0]:
                faults.append(Fault.at(loc, f"curve '{curve}' twice", "two different curves"))
            elif curve in taken:
                expected = "a curve in one contact only: split it where another body begins"
                faults.append(Fault.at(loc, f"curve '{curve}', which is in contact '{taken[curve]}' too", expected))
            else:
                taken[curve] = name
        if all(curve in outer and taken.get(curve) == name for curve in table.between):
            contacts[name] = table.between
    return contacts, faults


def _check_use(name: str, bounds: list[str], inside: list[str]) -> Fault | None:
    loc = ("curves", name)
    if bounds and inside:
        found = f"curve '{name}' in the boundary of {list_names(bounds)} and as a crack in {list_names(inside)}"
        return Fault.at(loc, found, "either a boundary or a crack")
    if len(bounds) > 2:
        found = f"curve '{name}' in the boundary of {len(bounds)} regions ({list_names(bounds)})"
        return Fault.at(loc, found, "one region, or two that share it: split the curve where a third region begins")
    if len(inside) > 1:
        found = f"crack '{name}' in {len(inside)} regions ({list_names(inside)})"
        return Fault.at(loc, found, "a crack inside one region: split it where it meets their interface")
    if not bounds and not inside:
        expected = "a use in the `boundary` or `cracks` of a region, as a tool, or no such curve"
        return Fault.at(loc, f"curve '{name}', which no region uses", expected)
    return None
