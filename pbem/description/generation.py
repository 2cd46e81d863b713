"""From the tables [[generate]] to curves, regions and laws, as if they were written one by one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

from pbem.description.effects import combine_laws
from pbem.description.families import list_named, spread_named
from pbem.description.field_tables import EigenstrainTable
from pbem.description.finding import Finding
from pbem.description.placement import Area, Body, make_ground, place_bodies
from pbem.description.schema import CaseFile, CurveTable, GenerateTable, LawTable, RegionTable, StageTable
from pbem.description.varying import ExpressionTable
from pbem.wording import list_names, suggest

Said = TypeVar("Said")

# From so many on, sides make no difference to how much room there is.
MANY = 1000


@dataclass(frozen=True)
class GeneratedGroup:
    """What one table [[generate]] made: `count` curves name_1, name_2, ... of one kind in a region."""

    name: str
    kind: str
    count: int
    region: str

    @property
    def members(self) -> tuple[str, ...]:
        """The names of its curves; each inclusion is a region of the same name."""
        return name_members(self.name, self.count)


def name_members(name: str, count: int) -> tuple[str, ...]:
    """name_1, name_2, ..."""
    return tuple(f"{name}_{number}" for number in range(1, count + 1))


@dataclass(frozen=True)
class Expansion:
    """The tables of a case with those that were generated, and for each generated name the number of its table."""

    curves: Mapping[str, CurveTable]
    regions: Mapping[str, RegionTable]
    interfaces: Mapping[str, LawTable]
    stages: tuple[StageTable, ...]
    temperature: Mapping[str, float | ExpressionTable]
    eigenstrain: Mapping[str, EigenstrainTable]
    groups: tuple[GeneratedGroup, ...]
    origin: Mapping[str, int]


def expand(case: CaseFile) -> tuple[Expansion | None, list[Finding]]:
    """Place what the tables [[generate]] ask for; None, and why, if they name what is not there or find no room."""
    findings = _check_names(case)
    if findings:
        return None, findings
    curves, regions = dict(case.curves), dict(case.regions)
    laws: dict[str, LawTable] = {}
    origin: dict[str, int] = {}
    ground = make_ground(case.generate) if case.generate else None
    for number, table in enumerate(case.generate):
        assert ground is not None
        bodies, area = place_bodies(table, ground)
        if len(bodies) < table.count:
            findings.append(_explain_lack(number, table, len(bodies), area))
            continue
        names = name_members(table.name, table.count)
        law = _take_law(table)
        curves |= zip(names, (_make_curve(table, body) for body in bodies), strict=True)
        laws |= dict.fromkeys(names, law)
        origin |= dict.fromkeys(names, number)
        _add_to_regions(regions, table, names)
    if findings:
        return None, findings
    for name, own in case.interfaces.items():
        laws[name] = combine_laws(laws[name], own) if name in laws else own
    groups = tuple(GeneratedGroup(table.name, table.kind, table.count, table.region) for table in case.generate)
    stages = tuple(_spread_groups(stage, groups) for stage in case.stages)
    inclusions = tuple(group for group in groups if group.kind == "inclusions")
    temperature, eigenstrain = _spread(case.temperature, inclusions), _spread(case.eigenstrain, inclusions)
    return Expansion(curves, regions, laws, stages, temperature, eigenstrain, groups, origin), []


def _check_names(case: CaseFile) -> list[Finding]:
    """Names that the tables use must be there, those that they make must not."""
    findings = []
    made: dict[str, int] = {}
    for number, table in enumerate(case.generate):
        known: list[tuple[str, str | None, Mapping[str, object]]] = [("region", table.region, case.regions)]
        known += [("material", table.material, case.materials)]
        for what, name, there in known:
            if name is not None and name not in there:
                found = f"unknown {what} '{name}'{suggest(name, there)}"
                expected = f"one of the {what}s: {list_names(there)}"
                findings.append(Finding(("generate", number, what), found, expected))
        if table.name in made:
            found = f"the name '{table.name}' of generate[{made[table.name] + 1}] again"
            findings.append(Finding(("generate", number, "name"), found, "a name of its own for each table"))
            continue
        made[table.name] = number
        taken = {**case.curves, **case.contacts, **(case.regions if table.kind == "inclusions" else {})}
        for name in taken:
            stem, _, digits = name.rpartition("_")
            if stem == table.name and digits.isdecimal() and str(int(digits)) == digits and (
                1 <= int(digits) <= table.count
            ):
                found = f"the name '{table.name}', which makes '{name}' a second time"
                findings.append(Finding(("generate", number, "name"), found, "names that the file does not use"))
                break
    return findings


def _explain_lack(number: int, table: GenerateTable, count: int, area: Area) -> Finding:
    """How many found a place at random, and what would be possible."""
    found = f"room for {count} of {table.count} {table.kind} at a distance of {table.distance:g}"
    if table.box is not None:
        expected = f"about {int(0.9 * count)} {table.kind} in this box, smaller ones, or a smaller distance"
        return Finding(("generate", number, "count"), found, expected)
    key = "density" if table.density is not None else "fraction"
    value = table.density or table.fraction or 0.0
    found += f" in an area of {area.size:.4g}, a {key} of {value * count / table.count:.3g}"
    if count == 0:  # nothing tells what would be possible
        return Finding(("generate", number, key), found, f"a lower {key}, or a smaller distance")
    possible = _find_possible(table, key, value * count / table.count)
    expected = f"a {key} of about {possible:.2g} at most, or a smaller distance"
    return Finding(("generate", number, key), found, expected)


def _find_possible(table: GenerateTable, key: str, reached: float) -> float:
    """A value that is possible: that which was reached, or less, as there is more room beyond the sides of a small area
    than of a large one."""
    for part in (0.9, 0.7, 0.5, 0.3):
        value = float(f"{part * reached:.1e}")
        if table.count > MANY:
            return value
        wider = table.model_copy(update={key: value})
        if len(place_bodies(wider, make_ground([wider]))[0]) == table.count:
            return value
    return 0.2 * reached


def _take_law(table: GenerateTable) -> LawTable:
    keys = [key for key in LawTable.model_fields if key in table.model_fields_set]
    return LawTable.model_construct(**{key: getattr(table, key) for key in keys})


def _make_curve(table: GenerateTable, body: Body) -> CurveTable:
    if table.kind == "inclusions":
        center = (body.start.real, body.start.imag)
        return CurveTable.model_construct(center=center, radius=body.radius, elements=table.elements)
    points = ((body.start.real, body.start.imag), (body.end.real, body.end.imag))
    return CurveTable.model_construct(points=points, elements=table.elements)


def _add_to_regions(regions: dict[str, RegionTable], table: GenerateTable, names: tuple[str, ...]) -> None:
    around = regions[table.region]
    if table.kind == "cracks":
        regions[table.region] = around.model_copy(update={"cracks": (*around.cracks, *names)})
        return
    assert table.material is not None
    regions[table.region] = around.model_copy(update={"boundary": (*around.boundary, *names)})
    for name in names:
        regions[name] = RegionTable.model_construct(material=table.material, boundary=(name,))


def _spread_groups(stage: StageTable, groups: tuple[GeneratedGroup, ...]) -> StageTable:
    """What a stage says of the name of a table it says of all that the table made, and that of a single one instead."""
    members = {group.name: group.members for group in groups}
    if members.keys() & set(list_named(stage)):
        stage = stage.model_copy(update=spread_named(stage, members))
    inclusions = tuple(group for group in groups if group.kind == "inclusions")
    grains = {group.name: group.members for group in inclusions}
    return stage.model_copy(update={
        "remove": tuple(each for name in stage.remove for each in grains.get(name, (name,))),
        "interfaces": _spread(stage.interfaces, groups), "temperature": _spread(stage.temperature, inclusions),
        "eigenstrain": _spread(stage.eigenstrain, inclusions),
    })


def _spread(values: Mapping[str, Said], groups: Sequence[GeneratedGroup]) -> dict[str, Said]:
    """What is said by the names of tables, of all that they made; what is said of a single one holds instead."""
    told = {group.name: group for group in groups if group.name in values}
    spread = {member: values[name] for name, group in told.items() for member in group.members}
    return {**spread, **{name: value for name, value in values.items() if name not in told}}
