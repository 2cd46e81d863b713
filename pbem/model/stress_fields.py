"""Fields of stress that fill whole regions: remote stress, gravity, and the in-situ stress of materials."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from pbem.description.case import Case
from pbem.description.schema import GravityTable, StressTable
from pbem.errors import Fault, KeyPath
from pbem.model.in_situ import LinearStress, check_rest, read_in_situ
from pbem.model.roles import unknown_name
from pbem.model.shaping import find_corners

Stress = tuple[float, float, float]


@dataclass(frozen=True)
class Backgrounds:
    """remote, gravity: values at the end of every stage; initial_stress: by the names of materials; rest_gravity: of
    [gravity], with which stress that grows with the coordinates is in balance."""

    remote: tuple[Stress, ...]
    gravity: tuple[tuple[float, float], ...]
    initial_stress: Mapping[str, LinearStress]
    rest_gravity: complex
    faults: tuple[Fault, ...]


def read_backgrounds(case: Case) -> Backgrounds:
    """Complete values for every stage; what a stage leaves out keeps the value reached before."""
    remote, gravity = [0.0, 0.0, 0.0], [0.0, 0.0]
    stresses, accelerations = [], []
    _update(remote, case.remote, ("sxx", "syy", "sxy"))
    _update(gravity, case.gravity, ("gx", "gy"))
    for stage in case.stages or (None,):
        if stage is not None:
            _update(remote, stage.remote, ("sxx", "syy", "sxy"))
            _update(gravity, stage.gravity, ("gx", "gy"))
        stresses.append((remote[0], remote[1], remote[2]))
        accelerations.append((gravity[0], gravity[1]))
    faults = [*_check_remote(case), *_check_gravity(case), *_check_materials(case)]
    at_rest = complex(case.gravity.gx, case.gravity.gy) if case.gravity else 0j
    initial = {}
    for name, table in case.initial_stress.items():
        initial[name], wrong = read_in_situ(("initial_stress", name), table, find_corners(case))
        faults += wrong
        if name in case.materials and not wrong:
            faults += _check_rest(case, name, initial[name], at_rest)
    return Backgrounds(tuple(stresses), tuple(accelerations), initial, at_rest, tuple(faults))


def _check_rest(case: Case, name: str, stress: LinearStress, at_rest: complex) -> Iterator[Fault]:
    loc: KeyPath = ("initial_stress", name)
    yield from check_rest(loc, stress, case.materials[name].density, at_rest)
    infinite = next((key for key, table in case.regions.items() if table.infinite and table.material == name), None)
    if infinite is not None and not stress.is_uniform:
        found = f"a stress that grows with the coordinates, in the infinite region '{infinite}'"
        yield Fault.at(loc, found, "a finite region for it: without end it has no bounds, and no energy")


def _update(values: list[float], table: StressTable | GravityTable | None, keys: tuple[str, ...]) -> None:
    for index, key in enumerate(keys):
        if table is not None and key in table.model_fields_set:
            values[index] = getattr(table, key)


def _check_remote(case: Case) -> Iterator[Fault]:
    if any(table.infinite for table in case.regions.values()):
        return
    places: list[KeyPath] = [("remote",)] if case.remote else []
    places += [("stages", number, "remote") for number, stage in enumerate(case.stages) if stage.remote]
    for loc in places:
        expected = "infinite = true in a region, or no such table"
        yield Fault.at(loc, "remote stress without an infinite region", expected)


def _check_gravity(case: Case) -> Iterator[Fault]:
    """Gravity has to act on something, and the weight of an infinite region has no support."""
    used = {name: case.materials[table.material] for name, table in case.regions.items()
            if table.material in case.materials}
    tables: list[tuple[KeyPath, GravityTable | None]] = [(("gravity",), case.gravity)]
    tables += [(("stages", number, "gravity"), stage.gravity) for number, stage in enumerate(case.stages)]
    for loc, table in tables:
        if table is None or not (table.gx or table.gy) or not used:
            continue
        if not any(material.density for material in used.values()):
            yield Fault.at(loc, "gravity on regions without density", "a density > 0 in the material of a region")
        for name, material in used.items():
            if case.regions[name].infinite and material.density:
                found = f"the weight of an infinite region ('{name}', density {material.density:g})"
                table_name = f"[initial_stress.{case.regions[name].material}]"
                expected = f"density = 0 there; its stress at rest goes into {table_name}"
                yield Fault.at(loc, found, expected)


def _check_materials(case: Case) -> Iterator[Fault]:
    for name in case.initial_stress:
        if name not in case.materials:
            yield unknown_name(("initial_stress", name), name, "material", case.materials)
