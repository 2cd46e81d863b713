"""The tables and keys of a case file, with their types, ranges and defaults (the meaning is in the descriptions).

What involves several keys at once (two conditions in one direction, friction and friction_angle, ...) is checked on
the file's own tables in `pbem.description.conflicts`, so that one wrong value does not hide other faults of the same
table.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from pbem.description import law_keys
from pbem.description.analysis_table import AnalysisTable
from pbem.description.construction import ConstructionTable, FitTable
from pbem.description.field_tables import (
    EigenstrainTable,
    GravityTable,
    InSituTable,
    PointForceTable,
    PointLoadTable,
    PointShiftTable,
    PointSupportTable,
    RemoteTable,
)
from pbem.description.rigid_tables import ForceTable, RigidTable, StageForceTable, StageRigidTable, ToolTable
from pbem.description.table import Table, UnitsTable
from pbem.description.values import (
    MOST_ELEMENTS,
    MOST_GENERATED,
    Angle,
    Count,
    Elements,
    Flag,
    Fraction,
    FrictionAngle,
    HalfTurn,
    NotNegative,
    Number,
    Part,
    Point,
    Poisson,
    Positive,
    Power,
    ProductTolerance,
    Spread,
    Text,
    Tolerance,
    check_option,
)
from pbem.description.varying import LinearValue, Strength, Value


class MaterialTable(Table):
    """A linear elastic, isotropic material. Regions refer to it by NAME."""

    young: Positive = Field(description="Young's modulus, stress")
    poisson: Poisson = Field(description="Poisson's ratio")
    plane: Literal["strain", "stress"] = Field("strain", description="plane strain or plane stress")
    density: NotNegative = Field(0.0, description="mass per volume, for `[gravity]`")
    expansion: Number = Field(0.0, description="strain per temperature, for `[temperature]`")


class CurveTable(Table):
    """A polyline, a circle, an arc, or a curve given by expressions, and its elements. Every curve is defined once;
    regions refer to it by NAME. Give one of `points`, `center` with `radius`, and `expression`, and one of `elements`
    and `size`."""

    points: Annotated[tuple[Point, ...], Field(min_length=2)] | None = Field(
        None, description="vertices of a polyline; its straight parts are called legs"
    )
    center: Point | None = Field(None, description="centre of a circle or an arc")
    radius: Positive | None = Field(None, description="its radius")
    angles: tuple[Angle, Angle] | None = Field(
        None,
        description="start and end of an arc, degrees; counter-clockwise if the second is larger; without this key, a "
        "full circle",
    )
    expression: tuple[Text, Text] | None = Field(
        None,
        description='x and y as functions of `t` from 0 to 1, e.g. `["2*t", "0.1*sin(2*pi*t)"]`; the elements are '
        "arcs through three points of the curve, or straight where it has corners or inflections",
    )
    elements: Elements | None = Field(
        None,
        description='number of elements: a total, or a list with one number for each leg; with `grading = "auto"` '
        "a minimum, see `pbem help accuracy`",
    )
    size: Positive | None = Field(
        None,
        description='largest element length; with a `grading` other than `"auto"` and `"none"`, that before the '
        "refinement",
    )
    grading: Literal["auto", "start", "end", "both", "none"] = Field(
        "auto",
        description='refinement towards the start or the end of the curve, towards both ends of each leg, or none; '
        '`"auto"`: towards corners, changes of '
        "condition or load, ends of contact and junctions, with elements as short as nearby faces require; any other "
        "value is kept, except next to crack tips and where a crack turns",
    )
    power: Power = Field(3.0, description="the ends of elements lie at t^power from a refined end")


class RegionTable(Table):
    """A body of one material: its boundary and its cracks, by the names of curves."""

    material: Text = Field(description="name of a material")
    boundary: tuple[Text, ...] = Field(
        (), description="curves around the body and around its holes, in any order and direction"
    )
    cracks: tuple[Text, ...] = Field((), description="curves inside the region, with two faces each")
    infinite: Flag = Field(
        False, description="the region is the exterior of its loops; without loops it is the whole plane"
    )


class SpringTable(Table):
    """An elastic support in all stages: stress per displacement, along the normal and along the curve."""

    kn: Strength = Field(
        0.0, description="elastic support: adds -kn (un - end_n) to tn in all stages; may vary, but not with `t`"
    )
    ks: Strength = Field(0.0, description="the same along the curve: adds -ks (us - end_s) to ts")


class StageConditionTable(Table):
    """Displacement or traction in two directions; a direction without either is free of traction."""

    ux: Value | None = Field(None, description="displacement along x")
    uy: Value | None = Field(None, description="displacement along y")
    tx: Value | None = Field(None, description="or traction along x")
    ty: Value | None = Field(None, description="or traction along y")
    un: Value | None = Field(
        None, description="or displacement along the outward normal; not together with x and y components"
    )
    us: Value | None = Field(None, description="displacement along the normal turned by +90 degrees")
    tn: Value | None = Field(None, description="or traction along the outward normal")
    ts: Value | None = Field(None, description="or traction along the normal turned by +90 degrees")
    pressure: Value | None = Field(None, description="`tn = -pressure`, `ts = 0`")
    end_n: Value | None = Field(None, description="displacement of the far end of a spring `kn`, along the normal")
    end_s: Value | None = Field(None, description="the same for a spring `ks`, along the normal turned by +90 degrees")
    rigid: StageRigidTable | None = Field(None, description="the curve is rigid, with given forces or motions")
    force: StageForceTable | None = Field(None, description="or a traction with this resultant")


class ConditionTable(StageConditionTable):
    """Conditions on a curve of one region: displacement or traction in two directions. A direction without either is
    free of traction."""

    rigid: RigidTable | None = Field(None, description="the curve is rigid, with given forces or motions")
    force: ForceTable | None = Field(None, description="or a traction with this resultant")
    spring: SpringTable | None = Field(None, description="an elastic support, in addition to tractions")


class LawTable(Table):
    """The law between the two faces of an interface (a curve of two regions) or of a crack. Strengths and pressures
    are stresses."""

    law: law_keys.LawName = None
    friction: Strength | None = Field(
        None, description="friction coefficient; 0 if `friction_angle` is not given either; f0 of `rate_and_state`"
    )
    friction_angle: FrictionAngle | None = Field(None, description="or the angle of friction, degrees")
    cohesion: Strength = Field(0.0, description="friction bound at zero normal traction, or shear strength")
    tensile_strength: Strength = Field(0.0, description="normal tension carried before the faces separate")
    cohesion_lost: Flag = Field(
        False, description="cohesion and tensile strength are lost at the first slip or separation (a brittle bond)"
    )
    friction_dynamic: Strength | None = Field(None, description="friction decreases linearly to this coefficient ...")
    slip_distance: Positive | None = Field(
        None, description="... over this length of slip; L of `rate_and_state`, over which the state evolves"
    )
    dilation_angle: law_keys.DilationAngle = None
    dilation_slip: law_keys.DilationSlip = None
    rate_effect: law_keys.RateEffect = None
    state_effect: law_keys.StateEffect = None
    reference_rate: law_keys.ReferenceRate = None
    initial_state: law_keys.InitialState = None
    fracture_energy: law_keys.FractureEnergy = None
    fracture_energy_shear: law_keys.ShearFractureEnergy = None
    softening: law_keys.Softening = None
    residual_friction_angle: law_keys.ResidualFrictionAngle = None
    jrc: law_keys.Roughness = None
    jcs: law_keys.WallStrength = None
    closure: law_keys.Closure = None
    dilation_part: law_keys.DilationPart = None
    peak_slip: law_keys.PeakSlip = None
    normal_stiffness: Positive | None = Field(
        None, description="elastic joint in series with the law, stress per length; rigid by default"
    )
    tangential_stiffness: Positive | None = Field(None, description="the same along the faces")
    gap: Value = Field(
        0.0, description="initial opening; if negative, the interference by which the unstressed faces would overlap"
    )
    pressure: Value = Field(
        0.0, description="fluid pressure on open faces; faces separate when their compression falls to this value"
    )
    pressurised: Literal["open", "all"] = Field(
        "open",
        description='`"all"`: the fluid fills closed parts too; friction acts on the compression less the pressure',
    )
    file: Text | None = Field(None, description='Python file of a `"custom"` law, relative to the case file')
    parameters: Mapping[str, Number] = Field({}, description="numbers passed to the custom law")


class ContactTable(LawTable, FitTable):
    """Two different curves that may touch; their meshes need not match. The default law is `"coulomb"`; the initial
    gap follows from the geometry. All keys of `[interfaces.CURVE]` are accepted as well."""

    between: tuple[Text, Text] = Field(description="the two curves, in any order; results are given on the first one")


class GenerateTable(LawTable):
    """Generates many curves at random positions: cracks, or circular inclusions. All keys of `[interfaces.CURVE]` are
    accepted as well, for all of these curves."""

    kind: Literal["cracks", "inclusions"] = Field(description="what is generated")
    name: Text = Field(
        description="the curves are called NAME_1, NAME_2, ...; each inclusion is a region of the same name"
    )
    region: Text = Field(description="region that contains them")
    material: Text | None = Field(None, description="material of inclusions")
    count: Annotated[int, Field(strict=True, ge=1, le=MOST_GENERATED)] = Field(description="number of curves")
    elements: Annotated[int, Field(strict=True, ge=1, le=MOST_ELEMENTS)] = Field(description="elements on each curve")
    half_length: Positive | None = Field(None, description="half-length of cracks")
    radius: Positive | None = Field(None, description="radius of inclusions")
    distribution: Literal["uniform", "lognormal", "power"] = Field(
        "uniform",
        description='distribution of sizes; `"uniform"`: in size (1 +- spread); `"lognormal"`: the size is the median; '
        '`"power"`: from the size up to `largest`',
    )
    spread: Spread = Field(
        0.0,
        description="relative half-width of a uniform distribution; standard deviation of the logarithm of a lognormal "
        "one, truncated at three standard deviations",
    )
    exponent: Positive | None = Field(None, description="of a power law: the number decreases as size^-exponent")
    largest: Positive | None = Field(None, description="largest size of a power law")
    orientation: Angle | None = Field(
        None, description="orientation of cracks, degrees from the x axis; by default all directions are equally likely"
    )
    orientation_spread: HalfTurn = Field(0.0, description="orientations are uniform in orientation +- this, degrees")
    density: Positive | None = Field(
        None, description="number per unit area: the centres lie in an area of count / density"
    )
    fraction: Part | None = Field(None, description="or the fraction of the area covered by inclusions")
    box: tuple[Number, Number, Number, Number] | None = Field(
        None, description="or x0, y0, x1, y1 of a rectangle that contains them completely"
    )
    shape: Literal["square", "disc"] = Field("square", description="shape of the area of the centres")
    center: Point = Field((0.0, 0.0), description="centre of that area")
    distance: Positive = Field(
        description="smallest distance between any two, including those of other tables `[[generate]]`, and from the "
        "sides of a box"
    )
    seed: Annotated[int, Field(strict=True, ge=0, le=2**53)] = Field(
        1, description="seed of the random numbers: the same table gives the same model on every machine"
    )


class StageInterfaceTable(Table):
    """Values of an interface that can change from stage to stage."""

    pressure: Value = Field(description="fluid pressure at the end of the stage")


class StageTable(ConstructionTable):
    """A part of the load history, with the values at its end; in between they are linear. Stages follow each other in
    the order of the file. Values that a stage does not name stay as they are. Without `[[stages]]` all loads grow in
    proportion."""

    name: Text | None = Field(None, description="name used in messages and results")
    steps: Count = Field(10, description="load steps of the stage")
    duration: Positive | None = Field(
        None, description="duration of the stage, divided among its steps; required by laws that depend on time"
    )
    boundary: Mapping[str, StageConditionTable] = Field(
        {}, description="values at the end of the stage: `ux` to `pressure` as in `[boundary.CURVE]`"
    )
    tools: Mapping[str, StageRigidTable] = Field({}, description="forces or motions of a rigid tool")
    interfaces: Mapping[str, StageInterfaceTable] = Field({}, description="values of an interface or a crack")
    contacts: Mapping[str, StageInterfaceTable] = Field({}, description="values of a contact")
    remote: RemoteTable | None = Field(None, description="`sxx`, `syy`, `sxy` at the end of the stage")
    gravity: GravityTable | None = Field(None, description="`gx`, `gy` at the end of the stage")
    temperature: Mapping[str, LinearValue] = Field({}, description="temperature of a region at the end of the stage")
    eigenstrain: Mapping[str, EigenstrainTable] = Field({}, description="strain of a region at the end of the stage")
    point_loads: Mapping[str, PointForceTable] = Field({}, description="`fx`, `fy`, `moment` at the end of the stage")
    point_supports: Mapping[str, PointShiftTable] = Field({}, description="`ux`, `uy` at the end of the stage")


class SolverTable(Table):
    """Solution of the discrete equations."""

    linear: Literal["auto", "lu", "mumps", "gmres"] = Field(
        "auto",
        description='`"lu"`: dense; `"mumps"`: sparse, chosen by `"auto"` for several regions, unless they are few and '
        'small; `"gmres"`: uses old factors as preconditioner. The hierarchical operator always uses GMRES',
    )
    operator: Literal["auto", "dense", "hierarchical"] = Field(
        "auto",
        description='`"dense"`: every entry of the matrix is stored; `"hierarchical"`: far elements by the fast '
        'multipole method, chosen by `"auto"` if it is forecast to be faster, unless `linear` requests a factorisation',
    )
    tolerance: ProductTolerance = Field(1e-8, description="relative error of products with the hierarchical operator")
    newton_tolerance: Tolerance = Field(1e-9, description="relative residual of the discrete equations")
    newton_max_iterations: Count = Field(
        50, description="number of iterations of one search after which the load step is halved; slip-dependent "
                        "friction has two searches",
    )  # fmt: skip
    min_step: Fraction = Field(1e-4, description="smallest load step, as a fraction of a stage")


class InteriorTable(Table):
    """A grid of points inside the regions."""

    box: tuple[Number, Number, Number, Number] = Field(description="x0, y0, x1, y1: two opposite corners")
    shape: tuple[Count, Count] = Field(description="numbers of points along x and y")


class OutputTable(Table):
    """Output: points at which fields are stored, and the stored steps."""

    interior: InteriorTable | None = Field(None, description="a grid of points inside the regions")
    points: tuple[Point, ...] = Field((), description="single points")
    every: Count = Field(1, description="every n-th load step is stored, and the last one of each stage")


class CaseFile(Table):
    """All tables of a case file."""

    title: Text = Field("", description="title for pictures and results")
    units: UnitsTable = UnitsTable()
    materials: Annotated[Mapping[str, MaterialTable], Field(min_length=1)]
    curves: Mapping[str, CurveTable] = {}
    regions: Annotated[Mapping[str, RegionTable], Field(min_length=1)]
    generate: tuple[GenerateTable, ...] = ()
    boundary: Mapping[str, ConditionTable] = {}
    interfaces: Mapping[str, LawTable] = {}
    contacts: Mapping[str, ContactTable] = {}
    tools: Mapping[str, ToolTable] = {}
    remote: RemoteTable | None = Field(
        None, description="Stress at infinity, for infinite regions: uniform, or linear in x and y and in equilibrium "
        "with the weight of the region under `[gravity]`."
    )
    gravity: GravityTable | None = None
    initial_stress: Mapping[str, InSituTable] = Field(
        {}, description="In-situ stress of a material, present before any load and included in tractions and stresses. "
        "It is uniform, or linear in x and y and in equilibrium with the weight of the material under `[gravity]`, "
        "which then acts from the start."
    )
    temperature: Mapping[str, LinearValue] = Field(
        {}, description="Temperature of a region above that at which it fits without stress; grows with the load. Its "
        "material needs `expansion`. An expression must be linear in x and y."
    )
    eigenstrain: Mapping[str, EigenstrainTable] = Field(
        {}, description="Stress-free strain of a region (misfit, swelling, shrinkage); grows with the load. "
        "Expressions must be linear in x and y."
    )
    point_loads: Mapping[str, PointLoadTable] = Field(
        {}, description="A force at a point inside a region, or on a boundary where no displacement is prescribed; "
        "inside a region also a moment. Values are those at the end of the load."
    )
    point_supports: Mapping[str, PointSupportTable] = Field(
        {}, description="Displacement of a point of a boundary, for bodies that can move freely and whose loads "
        "balance: it fixes their rigid motion (three conditions for one body) and carries only the error of the mesh, "
        "which is stored as its reaction. NAME must not be that of a curve."
    )
    analysis: AnalysisTable = AnalysisTable()
    stages: tuple[StageTable, ...] = ()
    solver: SolverTable = SolverTable()
    petsc: Mapping[str, Annotated[str, BeforeValidator(check_option)]] = Field(
        {}, description="Any option of PETSc, without the leading dash; the command line overrides the file."
    )
    output: OutputTable = OutputTable()


def json_schema() -> dict[str, Any]:
    """The schema of a case file as JSON Schema, for editors that complete and check TOML."""
    return CaseFile.model_json_schema()
