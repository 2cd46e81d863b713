"""Fields of stress that fill whole regions: remote stress, gravity, and the in-situ stress of materials."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from pbem.description.case import Case
from pbem.description.field_tables import GravityTable, InSituTable, RemoteTable
from pbem.description.varying import ExpressionTable
from pbem.errors import Fault, KeyPath
from pbem.model.in_situ import AT_REST, BALANCED, COMPONENTS, LinearStress, check_rest, read_in_situ
from pbem.model.roles import unknown_name
from pbem.model.shaping import find_corners


@dataclass(frozen=True)
class StressFields:
    """remote, gravity: values at the end of every stage; initial_stress: by the names of materials; rest_gravity: of
    [gravity], with which stress that grows with the coordinates is in balance."""

    remote: tuple[LinearStress, ...]
    gravity: tuple[tuple[float, float], ...]
    initial_stress: Mapping[str, LinearStress]
    rest_gravity: complex
    faults: tuple[Fault, ...]


def read_stress_fields(case: Case) -> StressFields:
    """Complete values for every stage; what a stage leaves out keeps the value reached before."""
    given: dict[str, float | ExpressionTable] = dict.fromkeys(COMPONENTS, 0.0)
    gravity = [0.0, 0.0]
    stresses, accelerations = [], []
    faults: list[Fault] = []

    def read(loc: KeyPath, table: RemoteTable | None) -> LinearStress:
        """What is given so far, with the changes of a table."""
        given.update({key: getattr(table, key) for key in COMPONENTS if table and key in table.model_fields_set})
        stress, wrong = read_in_situ(loc, InSituTable.model_validate(given), find_corners(case))
        faults.extend(fault for fault in wrong if table and fault.path[-1] in table.model_fields_set)
        return stress

    remote = read(("remote",), case.remote)
    _update(gravity, case.gravity, ("gx", "gy"))
    for number, stage in enumerate(case.stages or (None,)):
        if stage is not None:
            remote = read(("stages", number, "remote"), stage.remote)
            _update(gravity, stage.gravity, ("gx", "gy"))
        stresses.append(remote)
        accelerations.append((gravity[0], gravity[1]))
    faults += [*_check_remote(case), *_check_gravity(case), *_check_materials(case)]
    at_rest = complex(case.gravity.gx, case.gravity.gy) if case.gravity else 0j
    initial = {}
    for name, table in case.initial_stress.items():
        initial[name], wrong = read_in_situ(("initial_stress", name), table, find_corners(case))
        faults += wrong
        if name in case.materials and not wrong:
            faults += _check_rest(case, name, initial[name], at_rest)
    faults = faults or [*_check_infinite(case, stresses, accelerations, initial)]
    return StressFields(tuple(stresses), tuple(accelerations), initial, at_rest, tuple(faults))


def _check_rest(case: Case, name: str, stress: LinearStress, at_rest: complex) -> Iterator[Fault]:
    loc: KeyPath = ("initial_stress", name)
    yield from check_rest(loc, stress, case.materials[name].density, at_rest)


def _check_infinite(
    case: Case, remote: Sequence[LinearStress], gravity: Sequence[tuple[float, float]],
    initial: Mapping[str, LinearStress],
) -> Iterator[Fault]:
    """A fault at the first stage at whose end stress far away is not in balance with the weight of an infinite region.
    """
    name = next((name for name, table in case.regions.items() if table.infinite), None)
    if name is None or case.regions[name].material not in case.materials:
        return
    density = case.materials[case.regions[name].material].density
    rest = initial.get(case.regions[name].material, AT_REST)
    for number, (stress, (x, y)) in enumerate(zip(remote, gravity, strict=True)):
        weight, held = density * complex(x, y), stress.divergence + rest.divergence
        if abs(weight + held) <= BALANCED * max(abs(weight), stress.steepest, rest.steepest):
            continue
        stage = case.stages[number] if case.stages else None
        if stage is not None and (stage.remote or stage.gravity):
            loc: KeyPath = ("stages", number, "remote" if stage.remote else "gravity")
        else:
            loc = ("remote",) if case.remote and not stress.is_uniform else ("gravity",)
        found = (f"a stress that grows by ({held.real:.6g}, {held.imag:.6g}) per length in the infinite region "
                 f"'{name}' against a weight of ({weight.real:.6g}, {weight.imag:.6g}) per volume")
        table_name = f"[initial_stress.{case.regions[name].material}]"
        expected = (f"a stress in [remote] or {table_name} that grows with x and y in balance with the weight: "
                    "d sxx/dx + d sxy/dy = -density gx, d sxy/dx + d syy/dy = -density gy; or density = 0 there")
        if not held:
            found = f"the weight of an infinite region ('{name}', density {density:g}), which no stress carries"
            expected = (f"density = 0 there; its stress at rest goes into {table_name}, where it may grow with x and y "
                        "in balance with the weight")
        yield Fault.at(loc, found, expected)
        return


def _update(values: list[float], table: GravityTable | None, keys: tuple[str, ...]) -> None:
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


def _check_materials(case: Case) -> Iterator[Fault]:
    for name in case.initial_stress:
        if name not in case.materials:
            yield unknown_name(("initial_stress", name), name, "material", case.materials)
