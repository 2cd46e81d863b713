"""The tables and keys of a case file, with their types, ranges and defaults (the meaning is in the descriptions).

What involves several keys at once (two conditions in one direction, friction and friction_angle, ...) is checked on
the file's own tables in `pbem.case.conflicts`, so that one wrong value does not hide other faults of the same table.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field
from pydantic_core import PydanticCustomError

MOST_ELEMENTS = 100_000
MOST_GENERATED = 1_000_000


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _check_number(value: object) -> object:
    """An integer of any length passes pydantic's float; one too long for a float is no number to compute with."""
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) > 10**300:
        raise PydanticCustomError("expected", "{expected}", {"expected": "a number of at most 300 digits"})
    return value


def _check_elements(value: object) -> object:
    """One error in place of one for each member of the union int | list of int."""
    counts = value if isinstance(value, list) else [value]
    expected = f"a whole number from 1 to {MOST_ELEMENTS}, or a list with one such number for each leg"
    if not counts:
        raise PydanticCustomError("expected", "{expected}", {"expected": expected})
    for count in counts:
        if not isinstance(count, int) or isinstance(count, bool) or not 1 <= count <= MOST_ELEMENTS:
            raise PydanticCustomError("expected", "{expected}", {"expected": expected})
    return tuple(value) if isinstance(value, list) else value


def _check_gap(value: object) -> object:
    if isinstance(value, dict):
        return value
    if not _is_number(value) or not 0 <= value <= LARGEST:  # type: ignore[operator]
        expected = "a finite number >= 0, or { expression = \"...\" }"
        raise PydanticCustomError("expected", "{expected}", {"expected": expected})
    return value


def _check_option(value: object) -> object:
    """A PETSc option's value; the library takes text only."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return value
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float) and abs(value) < float("inf"):
        return repr(value)
    raise PydanticCustomError("expected", "{expected}", {"expected": "a text, a finite number, true or false"})


# Numbers beyond this are slips of the pen, and their squares would overflow.
LARGEST = 1e100
_SHORT = BeforeValidator(_check_number)
Number = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-LARGEST, le=LARGEST), _SHORT]
Positive = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0, le=LARGEST), _SHORT]
NotNegative = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=LARGEST), _SHORT]
Angle = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-3600, le=3600), _SHORT]
Part = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0, lt=1), _SHORT]
Spread = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=10), _SHORT]
Poisson = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=-1, lt=0.5), _SHORT]
HalfTurn = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=90), _SHORT]
FrictionAngle = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, lt=90), _SHORT]
Power = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=1, le=10), _SHORT]
ProductTolerance = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=1e-13, le=1e-2), _SHORT]
Tolerance = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0, lt=1), _SHORT]
Fraction = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0, le=1), _SHORT]
Count = Annotated[int, Field(strict=True, ge=1, le=1_000_000)]
Text = Annotated[str, Field(strict=True)]
Flag = Annotated[bool, Field(strict=True)]
Point = tuple[Number, Number]
Elements = Annotated[int | tuple[int, ...], BeforeValidator(_check_elements)]


class Table(BaseModel):
    """A table of the case file: frozen, and without keys beyond its own."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class UnitsTable(Table):
    """Labels for plots and results."""

    length: Text = Field("", description="label of the unit of length")
    stress: Text = Field("", description="label of the unit of stress")


class MaterialTable(Table):
    """A linear elastic, isotropic material."""

    young: Positive = Field(description="Young's modulus, stress")
    poisson: Poisson = Field(description="Poisson's ratio")
    plane: Literal["strain", "stress"] = "strain"
    density: NotNegative = Field(0.0, description="mass per volume, used with [gravity]")


class CurveTable(Table):
    """A polyline, circle or arc, or a curve by expressions, and its elements."""

    points: Annotated[tuple[Point, ...], Field(min_length=2)] | None = Field(None, description="vertices of a polyline")
    center: Point | None = Field(None, description="center of a circle or arc")
    radius: Positive | None = Field(None, description="radius of a circle or arc, length")
    angles: tuple[Angle, Angle] | None = Field(
        None, description="degrees at which an arc starts and ends; counter-clockwise if the second is larger"
    )
    expression: tuple[Text, Text] | None = Field(None, description="x and y as functions of t from 0 to 1")
    elements: Elements | None = Field(None, description="number of elements: a total, or one number for each leg")
    size: Positive | None = Field(None, description="target length of an element, in place of `elements`")
    grading: Literal["auto", "start", "end", "both", "none"] = "auto"
    power: Power = Field(3.0, description="element ends at t^power from a refined end")


class RegionTable(Table):
    """A body of one material: its boundary and its cracks, by the names of curves."""

    material: Text
    boundary: tuple[Text, ...] = Field((), description="names of the curves that bound the region, in any order")
    cracks: tuple[Text, ...] = Field((), description="names of curves inside the region, two faces each")
    infinite: Flag = Field(False, description="the region is the outside of its loops")


class SpringTable(Table):
    """An elastic support: stress per displacement, along the normal and along the curve."""

    kn: NotNegative = 0.0
    ks: NotNegative = 0.0


class StageConditionTable(Table):
    """Displacement or traction in two directions; what is not given is free of traction."""

    ux: Number | None = None
    uy: Number | None = None
    tx: Number | None = None
    ty: Number | None = None
    un: Number | None = Field(None, description="displacement along the outward normal")
    us: Number | None = Field(None, description="displacement along the normal turned by +90 degrees")
    tn: Number | None = None
    ts: Number | None = None
    pressure: Number | None = Field(None, description="tn = -pressure, ts = 0")


class ConditionTable(StageConditionTable):
    """Displacement or traction in two directions, and springs in place of displacements."""

    spring: SpringTable | None = Field(None, description="adds -kn un to tn and -ks us to ts, through all stages")


class ExpressionTable(Table):
    """A quantity as a function of x and y."""

    expression: Text


class LawTable(Table):
    """What the two faces of an interface, crack or contact do. Strengths and pressure are stresses."""

    law: Literal["bonded", "coulomb", "open", "frictionless", "rate_and_state", "custom"] | None = Field(
        None, description="if not given, \"bonded\" on shared curves and \"coulomb\" on cracks and contacts; "
        "\"rate_and_state\": friction coefficient f0 + a ln(V/V0) + b ln(V0 theta/L) at the slip rate V, the state "
        "theta by the ageing law d theta/dt = 1 - V theta/L; every stage then needs its duration"
    )
    friction: NotNegative | None = Field(
        None, description="friction coefficient; of rate_and_state f0, that of steady slip at the reference rate"
    )
    friction_angle: FrictionAngle | None = Field(None, description="degrees")
    cohesion: NotNegative = 0.0
    tensile_strength: NotNegative = Field(0.0, description="normal tension carried before the faces part")
    cohesion_lost: Flag = Field(False, description="cohesion and tensile strength end with the first slip or parting")
    friction_dynamic: NotNegative | None = Field(None, description="friction coefficient after slip_distance")
    slip_distance: Positive | None = Field(
        None, description="slip, length, over which friction falls; L of rate_and_state, over which the state changes"
    )
    rate_effect: Positive | None = Field(None, description="a of rate_and_state: how friction rises with ln V")
    state_effect: NotNegative | None = Field(None, description="b of rate_and_state: how friction rises with ln theta")
    reference_rate: Positive | None = Field(None, description="V0 of rate_and_state, length/time")
    initial_state: Positive | None = Field(
        None, description="theta of rate_and_state at the beginning, time; slip_distance/reference_rate if not given"
    )
    normal_stiffness: Positive | None = Field(None, description="elastic joint in front of the law, stress/length")
    tangential_stiffness: Positive | None = Field(None, description="the same along the faces")
    gap: Annotated[float | ExpressionTable, BeforeValidator(_check_gap)] = Field(0.0, description="initial opening")
    pressure: Number = Field(0.0, description="fluid pressure on the open faces")
    pressurised: Literal["open", "all"] = "open"
    file: Text | None = Field(None, description="Python file of a custom law, relative to the case file")
    parameters: Mapping[str, Number] = Field({}, description="numbers that the custom law is called with")


class ContactTable(LawTable):
    """Two different curves that may touch, and their law."""

    between: tuple[Text, Text]


class GenerateTable(LawTable):
    """Random cracks or circular inclusions, each a curve `name_1`, `name_2`, ..., and the law of them all."""

    kind: Literal["cracks", "inclusions"]
    name: Text = Field(description="their curves (and regions of inclusions) are name_1, name_2, ...")
    region: Text = Field(description="region in which they lie")
    material: Text | None = Field(None, description="material of inclusions")
    count: Annotated[int, Field(strict=True, ge=1, le=MOST_GENERATED)]
    elements: Annotated[int, Field(strict=True, ge=1, le=MOST_ELEMENTS)] = Field(description="elements on each")
    half_length: Positive | None = Field(None, description="half-length of cracks")
    radius: Positive | None = Field(None, description="radius of inclusions")
    distribution: Literal["uniform", "lognormal", "power"] = Field(
        "uniform",
        description="of the sizes: uniform in size (1 +- spread), lognormal with the median size, or a power law from "
        "the size to the largest one",
    )
    spread: Spread = Field(0.0, description="of a uniform distribution, or standard deviation of the logarithm")
    exponent: Positive | None = Field(None, description="a of the power law: numbers fall like size^-a")
    largest: Positive | None = Field(None, description="largest size of the power law")
    orientation: Angle | None = Field(None, description="of cracks, degrees from x; without: all directions alike")
    orientation_spread: HalfTurn = Field(0.0, description="degrees: uniform in orientation +- spread")
    density: Positive | None = Field(None, description="number per unit area; the centres lie in the area that follows")
    fraction: Part | None = Field(None, description="or part of the area that inclusions take")
    box: tuple[Number, Number, Number, Number] | None = Field(
        None, description="or x and y of two opposite corners of a rectangle inside of which they lie"
    )
    shape: Literal["square", "disc"] = Field("square", description="of the area in which the centres lie")
    center: Point = Field((0.0, 0.0), description="of that area")
    distance: Positive = Field(description="least distance of any two, and from the sides of the box")
    seed: Annotated[int, Field(strict=True, ge=0, le=2**53)] = Field(1, description="of the random numbers")


class StressTable(Table):
    """Components of a stress."""

    sxx: Number = 0.0
    syy: Number = 0.0
    sxy: Number = 0.0


class GravityTable(Table):
    """Acceleration."""

    gx: Number = 0.0
    gy: Number = 0.0


class AnalysisTable(Table):
    """Which equations, elements and load steps."""

    scheme: Literal["SST", "DBEM", "HST", "THST"] = "SST"
    order: Annotated[int, Field(strict=True, ge=0, le=3)] = 2
    tips: Flag = Field(True, description="crack-tip elements with the square-root shape")
    steps: Count = Field(10, description="load steps; ignored when [[stages]] is given")
    accuracy: Part | None = Field(
        None, description="refine and solve again until the estimated relative error is below this"
    )


class StageInterfaceTable(Table):
    """What of an interface can change from stage to stage."""

    pressure: Number


class StageTable(Table):
    """A part of the load history: the values at its end."""

    name: Text | None = None
    steps: Count = 10
    duration: Positive | None = Field(
        None, description="time that the stage takes, shared by its steps; for laws that depend on time"
    )
    boundary: Mapping[str, StageConditionTable] = {}
    interfaces: Mapping[str, StageInterfaceTable] = {}
    contacts: Mapping[str, StageInterfaceTable] = {}
    remote: StressTable | None = None
    gravity: GravityTable | None = None


class SolverTable(Table):
    """How the discrete equations are solved."""

    linear: Literal["auto", "lu", "mumps", "gmres"] = "auto"
    operator: Literal["auto", "dense", "hierarchical"] = "auto"
    tolerance: ProductTolerance = 1e-8
    newton_tolerance: Tolerance = 1e-9
    newton_max_iterations: Count = 50
    min_step: Fraction = 1e-4


class InteriorTable(Table):
    """A grid of points inside the regions."""

    box: tuple[Number, Number, Number, Number] = Field(description="x and y of two opposite corners")
    shape: tuple[Count, Count] = Field(description="numbers of points along x and y")


class OutputTable(Table):
    """What is stored."""

    interior: InteriorTable | None = None
    points: tuple[Point, ...] = ()
    every: Count = Field(1, description="every n-th load step is stored, and the last of each stage")


class CaseFile(Table):
    """All tables of a case file."""

    title: Text = ""
    units: UnitsTable = UnitsTable()
    materials: Annotated[Mapping[str, MaterialTable], Field(min_length=1)]
    curves: Mapping[str, CurveTable] = {}
    regions: Annotated[Mapping[str, RegionTable], Field(min_length=1)]
    generate: tuple[GenerateTable, ...] = ()
    boundary: Mapping[str, ConditionTable] = {}
    interfaces: Mapping[str, LawTable] = {}
    contacts: Mapping[str, ContactTable] = {}
    remote: StressTable | None = None
    gravity: GravityTable | None = None
    initial_stress: Mapping[str, StressTable] = {}
    analysis: AnalysisTable = AnalysisTable()
    stages: tuple[StageTable, ...] = ()
    solver: SolverTable = SolverTable()
    petsc: Mapping[str, Annotated[str, BeforeValidator(_check_option)]] = {}
    output: OutputTable = OutputTable()


def json_schema() -> dict[str, Any]:
    """The schema of a case file as JSON Schema, for editors that complete and check TOML."""
    return CaseFile.model_json_schema()
