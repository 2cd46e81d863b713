"""What each curve is for, by the lists of the regions: outer boundary, interface of two regions, or crack."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from pbem.case import Case
from pbem.case.finding import list_names, suggest
from pbem.errors import Fault


@dataclass(frozen=True)
class Roles:
    """Every mapping is in the order of the curves in the file; curves with a faulty use are left out.

    outer: curve to its region; shared: curve to its two regions; cracks: curve to its region.
    """

    outer: Mapping[str, str]
    shared: Mapping[str, tuple[str, str]]
    cracks: Mapping[str, str]
    faults: tuple[Fault, ...]


def unknown_name(case: Case, loc: tuple[str | int, ...], name: str, what: str, known: Iterable[str]) -> Fault:
    """A fault for a name that nothing in the file defines, with the nearest one that is defined."""
    names = list(known)
    expected = f"one of the {what}s: {list_names(names)}" if names else f"no name: the file has no such {what}"
    return case.fault(loc, f"unknown {what} '{name}'{suggest(name, names)}", expected)


def resolve_roles(case: Case) -> Roles:
    """Find the use of every curve; faults for unknown, repeated and unused names."""
    faults: list[Fault] = []
    bounds: dict[str, list[str]] = {name: [] for name in case.curves}
    inside: dict[str, list[str]] = {name: [] for name in case.curves}
    for region, table in case.regions.items():
        if table.material not in case.materials:
            loc = ("regions", region, "material")
            faults.append(unknown_name(case, loc, table.material, "material", case.materials))
        for key, names, uses in (("boundary", table.boundary, bounds), ("cracks", table.cracks, inside)):
            for index, name in enumerate(names):
                loc_of_name = ("regions", region, key, index)
                if name not in case.curves:
                    faults.append(unknown_name(case, loc_of_name, name, "curve", case.curves))
                elif region in uses[name]:
                    faults.append(case.fault(loc_of_name, f"curve '{name}' a second time", "each curve once"))
                else:
                    uses[name].append(region)
    infinite = [region for region, table in case.regions.items() if table.infinite]
    for region in infinite[1:]:
        found = f"a second infinite region beside '{infinite[0]}'"
        faults.append(case.fault(("regions", region, "infinite"), found, "at most one: they would overlap far away"))
    outer, shared, cracks = {}, {}, {}
    for name in case.curves:
        fault = _check_use(case, name, bounds[name], inside[name])
        if fault:
            faults.append(fault)
        elif inside[name]:
            cracks[name] = inside[name][0]
        elif len(bounds[name]) == 2:
            shared[name] = (bounds[name][0], bounds[name][1])
        else:
            outer[name] = bounds[name][0]
    return Roles(outer, shared, cracks, tuple(faults))


def _check_use(case: Case, name: str, bounds: list[str], inside: list[str]) -> Fault | None:
    loc = ("curves", name)
    if bounds and inside:
        found = f"curve '{name}' in the boundary of {list_names(bounds)} and as a crack in {list_names(inside)}"
        return case.fault(loc, found, "either a boundary or a crack")
    if len(bounds) > 2:
        found = f"curve '{name}' in the boundary of {len(bounds)} regions ({list_names(bounds)})"
        return case.fault(loc, found, "one region, or two that share it: split the curve where a third region begins")
    if len(inside) > 1:
        found = f"crack '{name}' in {len(inside)} regions ({list_names(inside)})"
        return case.fault(loc, found, "a crack inside one region: split it where it meets their interface")
    if not bounds and not inside:
        expected = "a use in the `boundary` or `cracks` of a region, or no such curve"
        return case.fault(loc, f"curve '{name}', which no region uses", expected)
    return None
