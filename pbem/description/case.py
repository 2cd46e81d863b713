"""A case: everything that a model is made from, as a user says it, by calls or in a file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Self

from pydantic import ValidationError

from pbem.description.analysis_table import AnalysisTable
from pbem.description.conflicts import find_conflicts
from pbem.description.controls import DEEPEST, find_controls, find_depth
from pbem.description.families import find_families, list_named, spread_conditions, spread_laws, spread_stage
from pbem.description.field_tables import (
    EigenstrainTable,
    GravityTable,
    InSituTable,
    PointLoadTable,
    PointSupportTable,
    RemoteTable,
)
from pbem.description.finding import Finding
from pbem.description.generation import Expansion, GeneratedGroup, expand
from pbem.description.plain import make_plain
from pbem.description.repair import repair
from pbem.description.rigid_tables import ToolTable
from pbem.description.schema import (
    CaseFile,
    ConditionTable,
    ContactTable,
    CurveTable,
    GenerateTable,
    LawTable,
    MaterialTable,
    OutputTable,
    RegionTable,
    SolverTable,
    StageTable,
)
from pbem.description.summary import print_case, print_case_as_html
from pbem.description.table import UnitsTable
from pbem.description.translation import find_schema_findings
from pbem.description.varying import ExpressionTable
from pbem.errors import CaseError, Fault, KeyPath

# What messages call a case that no file has.
UNNAMED = "the case"


@dataclass(frozen=True, init=False, repr=False, eq=False)
class Case:
    """A valid case, with the tables and keys of a case file (`pbem help keys`) as attributes.

        Case(materials={"rock": {"young": 1000.0, "poisson": 0.2}}, curves={...}, regions={...})

    Curves, regions and laws of the tables [[generate]] are among the others, after them; groups: what each table made.
    A law that is given by the name of a trace, t12, is that of each of its pieces, t12.1, t12.2, ...; families: the
    traces that laws or stages name, with their pieces. given: the tables as they were given, without what was generated
    and without defaults; source: the file's path, as it was given. What follows from the geometry is checked by
    `pbem.model.build.build_model`.
    """

    title: str
    units: UnitsTable
    materials: Mapping[str, MaterialTable]
    curves: Mapping[str, CurveTable]
    regions: Mapping[str, RegionTable]
    generate: tuple[GenerateTable, ...]
    boundary: Mapping[str, ConditionTable]
    interfaces: Mapping[str, LawTable]
    contacts: Mapping[str, ContactTable]
    tools: Mapping[str, ToolTable]
    remote: RemoteTable | None
    gravity: GravityTable | None
    initial_stress: Mapping[str, InSituTable]
    temperature: Mapping[str, float | ExpressionTable]
    eigenstrain: Mapping[str, EigenstrainTable]
    point_loads: Mapping[str, PointLoadTable]
    point_supports: Mapping[str, PointSupportTable]
    analysis: AnalysisTable
    stages: tuple[StageTable, ...]
    solver: SolverTable
    petsc: Mapping[str, str]
    output: OutputTable
    given: Mapping[str, Any]
    source: str
    groups: tuple[GeneratedGroup, ...]
    origin: Mapping[str, int]
    families: Mapping[str, tuple[str, ...]]

    def __init__(self, /, **tables: Any) -> None:
        """Tables and keys of a case file; tuples and arrays may stand for lists, None for a key that is not given.

        Raises CaseError with every fault of tables and keys, each of which names the object and its field.
        """
        draft = draft_tables(tables)
        if draft.case is None or draft.faults:
            raise CaseError(UNNAMED, draft.faults)
        self._take(vars(draft.case))

    @classmethod
    def compose(cls, tables: CaseFile, expansion: Expansion | None, given: Mapping[str, Any], source: str) -> Self:
        """The case of tables that were checked, and of what they generate."""
        values: dict[str, Any] = {name: getattr(tables, name) for name in CaseFile.model_fields}
        values |= {"given": given, "source": source, "groups": (), "origin": {}}
        if expansion is not None:
            values |= {field.name: getattr(expansion, field.name) for field in fields(Expansion)}
        named = [*values["interfaces"], *values["boundary"]]
        named += [name for stage in values["stages"]
                  for name in (*stage.interfaces, *stage.boundary, *list_named(stage))]
        families = find_families(named, values["curves"])
        if families:
            values["boundary"] = spread_conditions(values["boundary"], families)
            values["interfaces"] = spread_laws(values["interfaces"], families)
            values["stages"] = tuple(spread_stage(stage, families) for stage in values["stages"])
        values["families"] = families
        case = cls.__new__(cls)
        case._take(values)
        return case

    def _take(self, values: Mapping[str, Any]) -> None:
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def __eq__(self, other: object) -> bool:
        """Whether the same tables were given."""
        return isinstance(other, Case) and self.given == other.given

    def __repr__(self) -> str:
        """A few lines: the names of what there is."""
        return print_case(self)

    def _repr_html_(self) -> str:
        """For notebooks."""
        return print_case_as_html(self)

    def put_pieces(self, members: Mapping[str, tuple[str, ...]], tables: Mapping[str, CurveTable]) -> Self:
        """The case with the pieces (by the name of their crack) of cracks that are cut in their place; tables: of all.

        Faults in it are still told at what was given.
        """
        def spread(names: Mapping[str, Any] | Sequence[str]) -> list[str]:
            return [piece for name in names for piece in members.get(name, (name,))]

        case = type(self).__new__(type(self))
        laws = {name: pieces for name, pieces in members.items() if pieces != (name,)}
        case._take(vars(self) | {
            "curves": {name: tables[name] if name in tables else self.curves[name] for name in spread(self.curves)},
            "regions": {
                name: table.model_copy(update={"cracks": tuple(spread(table.cracks))})
                for name, table in self.regions.items()
            },
            "interfaces": spread_laws(self.interfaces, laws),
            "stages": tuple(spread_stage(stage, laws) for stage in self.stages),
            "families": {**self.families, **laws},
        })
        return case

    def trace(self, fault: Fault) -> Fault:
        """The fault at what was given: of a curve, region or law that was generated, at the key it was made from; of a
        piece of a crack, at the crack; of its law, where it is said of its trace."""
        path = self._find_family(self._find_given(self._find_cut(fault.path)))
        return fault if path == fault.path else Fault.at(path, fault.found, fault.expected)

    def _find_cut(self, path: KeyPath) -> KeyPath:
        """The path with the crack in place of its piece."""
        if len(path) == 4 and path[:1] + path[2:3] == ("regions", "cracks") and isinstance(path[3], int):
            given, names = self.given["regions"].get(path[1], {}).get("cracks", ()), self.regions[str(path[1])].cracks
            whole = self._find_whole(names[path[3]]) if path[3] < len(names) else ""
            return (*path[:3], list(given).index(whole)) if whole in given else path
        return ("curves", self._find_whole(str(path[1])), *path[2:]) if len(path) > 1 and path[0] == "curves" else path

    def _find_whole(self, name: str) -> str:
        """The crack of which a curve is a piece, or the curve itself."""
        if name in self.given.get("curves", ()):
            return name
        return next((whole for whole, pieces in self.families.items() if name in pieces), name)

    def _find_family(self, path: KeyPath) -> KeyPath:
        at = path[2:] if len(path) > 2 and path[0] == "stages" else path
        if len(at) < 2 or at[0] not in ("interfaces", "boundary"):
            return path
        given: Any = self.given
        for part in (*path[: len(path) - len(at)], at[0]):
            given = given[part] if isinstance(part, int) else given.get(part, {})
        if at[1] in given and (len(at) == 2 or at[2] in given[at[1]]):
            return path
        families = (name for name, members in self.families.items() if at[1] in members and name in given)
        family = next(families, None)
        return path if family is None else (*path[: len(path) - len(at)], at[0], family, *at[2:])

    def _find_generated_region(self, path: KeyPath, swells: KeyPath) -> KeyPath:
        """The path with the name of the table [[generate]] in place of a region that it made, if that was given."""
        given: Any = self.given
        for part in (*path[: len(path) - len(swells)], swells[0]):
            given = given[part] if isinstance(part, int) else given.get(part, {})
        name = self.generate[self.origin[str(swells[1])]].name
        if swells[1] in given or name not in given:
            return path
        return (*path[: len(path) - len(swells)], swells[0], name, *swells[2:])

    def _find_given(self, path: KeyPath) -> KeyPath:
        if len(path) == 4 and path[0] == "regions" and isinstance(path[3], int):  # a name in a list
            names = getattr(self.regions.get(str(path[1])), str(path[2]), ())
            if path[3] < len(names) and names[path[3]] in self.origin:
                return ("generate", self.origin[names[path[3]]])
        swells = path[2:] if len(path) > 3 and path[0] == "stages" else path
        if len(swells) > 1 and swells[0] in ("temperature", "eigenstrain") and swells[1] in self.origin:
            return self._find_generated_region(path, swells)
        if len(path) < 2 or path[0] not in ("curves", "regions", "interfaces") or path[1] not in self.origin:
            return path
        if path[1] in self.given.get(str(path[0]), ()):
            return path
        number = self.origin[str(path[1])]
        place = ("generate", number)
        return (*place, path[2]) if len(path) > 2 and path[2] in self.generate[number].model_fields_set else place


@dataclass(frozen=True)
class Draft:
    """A case as far as it can be judged.

    case: None if too much is wrong; otherwise what is wrong is left out or stands in with a harmless value, so that
    the rest can be checked. conditions_known: no fault touches the conditions and laws.
    """

    case: Case | None
    faults: tuple[Fault, ...]
    conditions_known: bool = True


def draft_tables(tables: Mapping[str, Any]) -> Draft:
    """A case of tables given by calls; see `make_plain` for what may stand in them."""
    raw, faults = make_plain(tables)
    draft = draft_case(raw)
    return replace(draft, faults=(*faults, *draft.faults))


def draft_case(raw: Mapping[str, Any], source: str = UNNAMED) -> Draft:
    """A case of tables as far as possible, with all their faults in the order of the schema; never raises for what is
    wrong with them.

    raw: dictionaries, lists and plain values, as a reader of files has them; source: the file's path, as it was given.
    """
    deep = find_depth(raw)
    if deep is not None:
        found = f"tables and lists within each other more than {DEEPEST} deep"
        return Draft(None, (Fault.at(deep[:4], found, "the tables and keys of a case file"),))
    findings = find_controls(raw) + find_conflicts(raw) + find_schema_findings(raw)
    case, more = _compose(raw, findings, source)
    faults = [Fault.at(finding.loc, finding.found, finding.expected) for finding in (*findings, *more)]
    return Draft(case, _order(faults), not any(_concerns_loads(fault.path) for fault in faults))


def _compose(
    raw: Mapping[str, Any], findings: list[Finding], source: str
) -> tuple[Case | None, list[Finding]]:
    """The case with what it generates, as far as it can be judged, and what is wrong with generating it."""
    patched = repair(raw, findings)
    if patched is None:
        return None, []
    try:
        tables = CaseFile.model_validate(patched)
    except ValidationError:
        return None, []
    if not tables.generate:
        return Case.compose(tables, None, raw, source), []
    expansion, wrong = expand(tables)
    if expansion is None:
        return None, wrong
    return Case.compose(tables, expansion, raw, source), []


def _order(faults: Sequence[Fault]) -> tuple[Fault, ...]:
    """In the order of the schema, each once; unknown tables first."""
    tables = list(CaseFile.model_fields)
    ranks = {name: number for number, name in enumerate(tables)}
    return tuple(sorted(
        dict.fromkeys(faults), key=lambda fault: ranks.get(str(fault.path[0]), 0) if fault.path else 0
    ))


def _concerns_loads(path: KeyPath) -> bool:
    """Whether a fault here leaves open what holds and what loads the bodies."""
    if path and path[0] == "materials":
        return path[-1] == "density"
    loads = ("boundary", "interfaces", "contacts", "tools", "stages", "gravity", "point_loads", "point_supports")
    return bool(path) and (path[0] in loads or path[0] not in CaseFile.model_fields)
