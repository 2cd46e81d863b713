"""Fields of stress that fill whole regions: remote stress, gravity, and the in-situ stress of materials."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from pbem.description.case import Case
from pbem.description.schema import GravityTable, StressTable
from pbem.errors import Fault, KeyPath
from pbem.model.roles import unknown_name

Stress = tuple[float, float, float]


@dataclass(frozen=True)
class Backgrounds:
    """remote, gravity: values at the end of every stage; initial_stress: sxx, syy, sxy by the names of materials."""

    remote: tuple[Stress, ...]
    gravity: tuple[tuple[float, float], ...]
    initial_stress: Mapping[str, Stress]
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
    initial = {name: (table.sxx, table.syy, table.sxy) for name, table in case.initial_stress.items()}
    faults = [*_check_remote(case), *_check_gravity(case), *_check_materials(case)]
    return Backgrounds(tuple(stresses), tuple(accelerations), initial, tuple(faults))


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
