"""The model: physics and topology with every name resolved, and no elements but their numbers on each leg."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import pi
from typing import Literal

from pbem.description.generation import GeneratedGroup
from pbem.geometry.curve import Curve, find_middle, measure_spread
from pbem.geometry.loop import Loop
from pbem.model.in_situ import AT_REST, LinearStress
from pbem.model.material import Material
from pbem.model.point_loads import Force, PointLoad
from pbem.model.point_supports import PointSupport, Shift
from pbem.model.rigid_body import RigidBody, Values
from pbem.model.sliver import Tie
from pbem.model.swelling import Swelling
from pbem.model.varying import Value, Varying
from pbem.model.walls import Wall

# Of a tool, for points that no number of turns is inside for.
NO_INSIDE = -(10**6)
Quantity = Literal["displacement", "traction"]
# How faces are held that do not follow their law.
Hold = Literal["closed", "open"]


@dataclass(frozen=True)
class Region:
    """loops: the outer one (absent if infinite) and the inner ones; cracks: names of curves inside, two faces each.

    A rigid tool is the rigid body of the same name; its loops are its curves, open or closed, each by itself.
    removed: gone, in a model as it is in a stage (see pbem.model.construction).
    """

    name: str
    material: Material
    loops: tuple[Loop, ...]
    cracks: tuple[str, ...] = ()
    infinite: bool = False
    removed: bool = False

    @property
    def rigid(self) -> bool:
        """Whether it is a rigid tool."""
        return self.material.rigid is not None


@dataclass(frozen=True)
class Law:
    """What an interface or crack does. All strengths are stresses >= 0; `friction` is the friction coefficient.

    kind: "bonded" never slips nor parts; "coulomb" sticks, slips, parts; "open" never touches; "custom" is Coulomb-like
    with the friction bound of the function that the Python file `file` registers, called with `parameters`; others are
    those of `pbem.contact.strength.LAWS`, with these parameters and none of the strengths; but "cohesive" has them.
    gap: initial normal opening (length); negative: interference. What may vary along the curve is a number or Varying.
    pressurised: "open": fluid pressure acts in open parts only; "all": in closed parts too.
    cohesion_lost: cohesion and tensile strength are gone after the first slip or parting.
    friction_dynamic, slip_distance: friction falls linearly from `friction` to friction_dynamic over that slip.
    normal_stiffness, tangential_stiffness: elastic joint in front of the law (stress/length); None is rigid.
    softening: of a cohesive law, its shape (see pbem.contact.softening).
    frictionless: that there is no friction was said, by `law = "frictionless"` or `friction = 0`.
    """

    kind: Literal["bonded", "coulomb", "open", "custom", "rate_and_state", "cohesive", "barton_bandis"]
    friction: Value = 0.0
    cohesion: Value = 0.0
    tensile_strength: Value = 0.0
    gap: Value = 0.0
    pressurised: Literal["open", "all"] = "open"
    cohesion_lost: bool = False
    friction_dynamic: Value | None = None
    slip_distance: float | None = None
    normal_stiffness: float | None = None
    tangential_stiffness: float | None = None
    file: str | None = None
    parameters: Mapping[str, Value] = field(default_factory=dict)
    softening: str | None = None
    frictionless: bool = field(default=False, compare=False)


@dataclass(frozen=True, slots=True)
class Interface:
    """A curve shared by two regions, or a crack in one region (`second` is None).

    The first side is the side of the first region that lists the curve; of a crack, the side on the left of the
    curve's direction.
    """

    name: str
    first: str
    second: str | None
    law: Law


@dataclass(frozen=True)
class Contact:
    """Two different outer curves that may touch; their meshes need not match, the gap follows from the geometry.

    first, second: names of the curves; the pairs lie on the first, which gives their normal. Neither has a
    Condition: where they do not touch they are free of traction. overlap: how deep the bodies lie in each other as they
    are drawn, at most (length); 0 where they do not. slave: the curve whose nodes the pairs belong to, where the meshes
    do not choose it.
    """

    name: str
    first: str
    second: str
    law: Law
    overlap: float = 0.0
    slave: str = ""


@dataclass(frozen=True)
class Condition:
    """What is known on an outer curve, in two directions: x, y (global) or normal (outward), tangential (local).

    known: per direction the quantity whose values the stages give; the other one is unknown.
    stiffness: Winkler springs per direction (stress/length), which may vary along the curve: the traction is the known
    one minus stiffness times the displacement against the springs' far ends; zero where the displacement is known.
    in_axes: the known tractions are given along x and y all the same, beside springs in the local frame.
    """

    curve: str
    frame: Literal["global", "local"] = "global"
    known: tuple[Quantity, Quantity] = ("traction", "traction")
    stiffness: tuple[Value, Value] = (0.0, 0.0)
    in_axes: bool = False

    @property
    def value_frame(self) -> Literal["global", "local"]:
        """The directions along which values are given."""
        return "global" if self.in_axes else self.frame


@dataclass(frozen=True)
class Construction:
    """What there is in a stage.

    joints: of interfaces, cracks and contacts that do not follow their law: "closed" faces are bonded where they lie,
    "open" ones never touch, as are those whose region is gone. removed: regions that are gone, in the order of the
    file.
    """

    joints: Mapping[str, Hold] = field(default_factory=dict)
    removed: tuple[str, ...] = ()


@dataclass(frozen=True)
class Stage:
    """A part of the load history: the values at its end, linear from those at the end of the stage before (0 at first);
    what depends on time by itself has its own value at every time.

    boundary: for every outer curve its two known values, in the frame of its Condition (complete: values that the
    file leaves out are carried over); pressure: fluid pressure of every interface. remote: stress sxx, syy, sxy at
    infinity, for infinite regions, at the model's middle; remote_growth: how it grows from there; gravity: acceleration
    (gx, gy), times the materials' densities. duration: time, shared by the steps; 0 where there is no time. swelling:
    strain without stress of the regions that have any. point_forces: force along x and y and moment of every point
    load. support_values: displacement along x and y of every point support. ends: of the curves whose springs' far ends
    move: by how much, along the normal and the curve. rigid: of every rigid body its three forces or motions, rotations
    in degrees. construction: which faces are held otherwise than by their law, and which regions are gone. walls:
    tractions on the other sides of these.
    """

    name: str
    steps: int
    boundary: Mapping[str, tuple[Value, Value]]
    pressure: Mapping[str, Value]
    remote: tuple[float, float, float] = (0.0, 0.0, 0.0)
    gravity: tuple[float, float] = (0.0, 0.0)
    duration: float = 0.0
    swelling: Mapping[str, Swelling] = field(default_factory=dict)
    point_forces: Mapping[str, Force] = field(default_factory=dict)
    support_values: Mapping[str, Shift] = field(default_factory=dict)
    ends: Mapping[str, tuple[Value, Value]] = field(default_factory=dict)
    remote_growth: LinearStress = AT_REST
    rigid: Mapping[str, Values] = field(default_factory=dict)
    construction: Construction = field(default_factory=Construction)
    walls: Mapping[str, Wall] = field(default_factory=dict)


def find_time(stages: Sequence[Stage], number: int, factor: float) -> float:
    """The time at a fraction of a stage; stages without durations take 1 each."""
    durations = [each.duration or 1.0 for each in stages[: number + 1]]
    return sum(durations[:-1]) + factor * durations[-1]


def list_timed(stage: Stage) -> list[Varying]:
    """The loads of a stage that depend on time by themselves."""
    values = [*(each for pairs in (stage.boundary, stage.ends) for pair in pairs.values() for each in pair),
              *stage.pressure.values()]
    values += [each for values in stage.rigid.values() for each in values]
    values += [each for wall in stage.walls.values() for each in wall.values]
    return [value for value in values if isinstance(value, Varying) and value.timed]


def list_wet(model: Model) -> tuple[str, ...]:
    """The contacts in which there is a fluid in any stage."""
    wet = {name for stage in model.stages for name, pressure in stage.pressure.items() if pressure}
    return tuple(name for name in model.contacts if name in wet)


@dataclass(frozen=True)
class Analysis:
    """scheme: which equation is collocated on which face; order: of the polynomials; tips: crack-tip elements.

    accuracy: the mesh is refined until the estimated relative error is below it; None: it is taken as it is.
    grade_contact_ends: whether elements are graded towards the ends of contact that were found; "auto": if that is
    worth its price.
    """

    scheme: Literal["SST", "DBEM", "HST", "THST"] = "SST"
    order: int = 2
    tips: bool = True
    accuracy: float | None = None
    grade_contact_ends: bool | Literal["auto"] = "auto"


# How the operator of the integral equations is stored.
Operator = Literal["auto", "dense", "hierarchical"]


@dataclass(frozen=True)
class SolverOptions:
    """How Newton's method and its linear systems are run; petsc: options without the leading dash.

    tolerance: relative error of the hierarchical operator's products.
    """

    linear: Literal["auto", "lu", "mumps", "gmres"] = "auto"
    operator: Operator = "auto"
    tolerance: float = 1e-8
    newton_tolerance: float = 1e-9
    newton_max_iterations: int = 50
    min_step: float = 1e-4
    petsc: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Model:
    """size: largest extent of all curves (length); curves are in the order of the file, as are the regions.

    interfaces: every shared curve, in the order of the file, then every crack. conditions: every outer curve (of
    one region), in the order of the file. crack_tips: per crack whether its start and end are tips.
    contacts: pairs of curves that may touch. rigid: curves that stay rigid, and tools. closing: contacts, and
    interfaces with a gap, that touch only once the loads have moved a body that nothing else holds.
    interior_points: where displacement and stress are asked for, those of the grid first, x fastest, then single
    points; interior_grid: the grid's numbers of points along x and y.
    initial_stress: in-situ stress of materials by name, there before any load. rest_gravity: acceleration that it is in
    balance with where it grows with the coordinates, which acts on these materials from the start.
    origin: point of the user's coordinates about which those of the model are, 0 unless the model is far from there.
    groups: the curves that were generated together. ties: bits of interfaces and cracks in narrow wedges whose pairs
    follow the status of the pair next to them. law_texts: contents of the files of custom laws, by their paths, as they
    were when the case was read. overrides: the values that were set beside `source`, a line KEY = VALUE each.
    point_loads: where forces act at single points. point_supports: where points of free bodies are.
    notes: what the program chose for the user (grading, split legs, ...), one sentence each, for log and check.
    refined: elements were halved after the case was read, where contacts did not settle or end. given_gradings: curves
    whose grading is the user's, and those by expressions, whose elements are chords. traces: of the curves that are
    pieces of a trace the name of that.
    """

    title: str
    units_length: str
    units_stress: str
    source: str
    regions: tuple[Region, ...]
    curves: Mapping[str, Curve]
    interfaces: Mapping[str, Interface]
    conditions: Mapping[str, Condition]
    crack_tips: Mapping[str, tuple[bool, bool]]
    stages: tuple[Stage, ...]
    analysis: Analysis
    solver: SolverOptions
    output_every: int
    size: float
    notes: tuple[str, ...] = ()
    initial_stress: Mapping[str, LinearStress] = field(default_factory=dict)
    rest_gravity: complex = 0j
    contacts: Mapping[str, Contact] = field(default_factory=dict)
    rigid: Mapping[str, RigidBody] = field(default_factory=dict)
    closing: frozenset[str] = frozenset()
    interior_points: tuple[complex, ...] = ()
    interior_grid: tuple[int, int] | None = None
    groups: tuple[GeneratedGroup, ...] = ()
    ties: tuple[Tie, ...] = ()
    law_texts: Mapping[str, str] = field(default_factory=dict)
    overrides: str = ""
    origin: complex = 0j
    point_loads: Mapping[str, PointLoad] = field(default_factory=dict)
    point_supports: Mapping[str, PointSupport] = field(default_factory=dict)
    refined: bool = False
    given_gradings: frozenset[str] = frozenset()
    traces: Mapping[str, str] = field(default_factory=dict)

    @cached_property
    def timed(self) -> bool:
        """Whether some load depends on time by itself, so that loads are not linear within a stage."""
        return any(list_timed(stage) for stage in self.stages)

    def find_time(self, stage: int, factor: float) -> float:
        """The time at a fraction of a stage; stages without durations take 1 each."""
        return find_time(self.stages, stage, factor)

    @cached_property
    def middle(self) -> complex:
        """The mean place of all curves, which the strain of stress far away does not move."""
        return find_middle(self.curves)

    @cached_property
    def grows_without_end(self) -> bool:
        """Whether the stress of an infinite region does, so that its energy has no bounds."""
        infinite = [region.material.name for region in self.regions if region.infinite]
        grown = [self.initial_stress[name] for name in infinite if name in self.initial_stress]
        return not all(each.is_uniform for each in (*grown, *(stage.remote_growth for stage in self.stages)))

    @cached_property
    def point_loads_by_region(self) -> dict[str, tuple[PointLoad, ...]]:
        """The point loads of every region that has any."""
        regions = dict.fromkeys(load.region for load in self.point_loads.values())
        return {
            name: tuple(load for load in self.point_loads.values() if load.region == name) for name in regions
        }

    @cached_property
    def logarithm_lengths(self) -> dict[str, float]:
        """The unit of the logarithm in the equations of every region with point loads, and of infinite ones:
        `bem.operator.collect_sources`."""
        return {
            region.name: 8 * measure_spread(self.curves, (
                *(side.curve for loop in region.loops for side in loop.sides), *region.cracks))
            for region in self.regions if region.infinite or region.name in self.point_loads_by_region
        }  # fmt: skip

    @cached_property
    def self_energy_lengths(self) -> dict[str, float]:
        """The same lengths as energies count, whatever the mesh and the cracks are: of a region's loops over pi; of a
        plane without loops the largest distance of two point loads, or, if there is no such, of the cracks over pi. At
        this distance displacements of point loads, or of a net force on a plane, are zero."""
        lengths = {}
        for region in self.regions:
            if region.name in self.logarithm_lengths:
                around = tuple(side.curve for loop in region.loops for side in loop.sides)
                places = [load.place for load in self.point_loads_by_region.get(region.name, ())]
                apart = max((abs(a - b) for a in places for b in places), default=0.0)
                of_curves = sum(self.curves[name].length for name in around or region.cracks) / pi
                lengths[region.name] = of_curves if around or not apart else apart
        return lengths

    @property
    def finite_regions(self) -> list[int]:
        """Numbers of the elastic regions that have an outer boundary."""
        return [number for number, region in enumerate(self.regions) if not region.infinite and not region.rigid]

    @property
    def turns_outside(self) -> list[int]:
        """Per region what its loops lack of one turn about points inside; of tools, which have no inside, too many."""
        return [NO_INSIDE if region.rigid else int(region.infinite) for region in self.regions]
