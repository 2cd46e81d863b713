"""What stays rigid: curves of bodies, and tools; and tractions with a given resultant."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from pbem.arrays import Complex, Real
from pbem.description.case import Case
from pbem.description.rigid_tables import StageForceTable, StageRigidTable
from pbem.description.varying import VaryingTable
from pbem.errors import Fault, KeyPath
from pbem.geometry.curve import Curve
from pbem.geometry.expression import list_names
from pbem.model.given import read_value
from pbem.model.roles import Roles, unknown_name
from pbem.model.varying import Value, Varying

Given = Literal["force", "motion"]
Values = tuple[Value, Value, Value]
NOTHING: Values = (0.0, 0.0, 0.0)
FORCES, MOTIONS = ("fx", "fy", "moment"), ("ux", "uy", "rotation")
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)


@dataclass(frozen=True)
class RigidBody:
    """Curves that move as one, by a displacement along x and y and a rotation about a point.

    curves: of bodies; of a tool, which is a region of its own. known: per motion whether it is given, or its force
    (along x, y, moment about the point), by the values of the stages, rotations in degrees. about: the point in the
    user's coordinates; None is the centroid of the curves.
    """

    name: str
    curves: tuple[str, ...]
    known: tuple[Given, Given, Given]
    about: complex | None = None
    tool: bool = False


@dataclass(frozen=True)
class Spread:
    """A traction on a curve that has a given resultant: uniform, or linear in x and y. about: as of a rigid body."""

    curve: str
    linear: bool
    about: complex | None = None


@dataclass(frozen=True)
class RigidLoading:
    """bodies, spreads: by name; stages: for each stage the complete values by name, of spreads the three forces."""

    bodies: Mapping[str, RigidBody]
    spreads: Mapping[str, Spread]
    stages: tuple[Mapping[str, Values], ...]
    faults: tuple[Fault, ...]


def read_rigid_loading(case: Case, roles: Roles) -> RigidLoading:
    """All that is rigid, resultants of tractions, and complete values for every stage; with the faults of their keys.
    """
    faults: list[Fault] = []
    bodies: dict[str, RigidBody] = {}
    spreads: dict[str, Spread] = {}
    values: dict[str, list[list[Value]]] = {}
    count = max(len(case.stages), 1)
    for loc, name, base, changes in _list_tables(case):
        table: Any = base
        if table is None:
            faults += [Fault.at(each, f"{each[-1]} for the first time in a stage",
                                f"the table [{'.'.join(map(str, loc))}], which says what kind it is")
                       for each, _ in changes]
            continue
        spread = loc[-1] == "force"
        known, wrong = _find_known(loc, table, changes)
        faults += wrong
        about = None if table.about is None else complex(*table.about)
        if spread:
            spreads[name] = Spread(name, table.how == "linear", about)
            faults += [Fault.at((*each, "moment"), 'a moment with how = "uniform"', 'how = "linear", or no moment')
                       for each, change in changes if change.moment is not None and table.how == "uniform"]
        else:
            bodies[name] = RigidBody(name, (name, *table.curves), known, about, loc[0] == "tools")
        history: list[list[Value]] = []
        now: list[Value] = [0.0, 0.0, 0.0]
        for number in range(count):
            tables = [*([(loc, table)] if number == 0 else []), *(each for each in changes if each[0][1] == number)]
            for place, each in tables:
                for axis, key, given in _list_values(each):
                    now[axis], wrong = _read(case, (*place, key), given)
                    faults += wrong
            history.append(list(now))
        values[name] = history
    faults += _check_curves(case, roles, bodies, spreads)
    stages = tuple({name: (each[k][0], each[k][1], each[k][2]) for name, each in values.items()} for k in range(count))
    return RigidLoading(bodies, spreads, stages, tuple(faults))


def _list_tables(case: Case) -> Iterator[tuple[KeyPath, str, Any, list[tuple[KeyPath, Any]]]]:
    """Place, name, first table (None without) and the changes in stages, of all that is rigid or a resultant."""
    named = dict.fromkeys([*case.boundary, *(name for stage in case.stages for name in stage.boundary)])
    for name in named:
        for key in ("rigid", "force"):
            base = getattr(case.boundary.get(name), key, None)
            changes: list[tuple[KeyPath, Any]] = [
                (("stages", number, "boundary", name, key), getattr(stage.boundary[name], key))
                for number, stage in enumerate(case.stages)
                if name in stage.boundary and getattr(stage.boundary[name], key) is not None
            ]
            if base is not None or changes:
                yield ("boundary", name, key), name, base, changes
    for name, table in case.tools.items():
        changes = [(("stages", number, "tools", name), stage.tools[name])
                   for number, stage in enumerate(case.stages) if name in stage.tools]
        yield ("tools", name), name, table, changes


def _list_values(table: StageRigidTable | StageForceTable) -> Iterator[tuple[int, str, float | VaryingTable]]:
    for keys in (FORCES, MOTIONS):
        for axis, key in enumerate(keys):
            given = getattr(table, key, None)
            if given is not None:
                yield axis, key, given


def _find_known(
    loc: KeyPath, table: Any, changes: Sequence[tuple[KeyPath, Any]]
) -> tuple[tuple[Given, Given, Given], list[Fault]]:
    """Whether a force or a motion is given in each direction: the same in all stages."""
    known: list[Given | None] = [None, None, None]
    faults = []
    for place, each in [(loc, table), *changes]:
        for axis, key, _ in _list_values(each):
            kind: Given = "motion" if key in MOTIONS else "force"
            early = place is loc or place[1] == 0
            if known[axis] not in (None, kind) or (kind == "motion" and known[axis] is None and not early):
                other = FORCES[axis] if kind == "motion" else MOTIONS[axis]
                found = f"'{key}' where '{other}' was given before" if known[axis] else f"'{key}' in a later stage only"
                faults.append(Fault.at((*place, key), found, "the same kind in a direction through all stages"))
            elif known[axis] is None:
                known[axis] = kind
        if place is loc and (not changes or changes[0][0][1] != 0):
            known = [kind or "force" for kind in known]
    first, second, third = (kind or "force" for kind in known)
    return (first, second, third), faults


def _read(case: Case, loc: KeyPath, given: float | VaryingTable) -> tuple[Value, list[Fault]]:
    """A number, or an expression of the time alone."""
    value, faults = read_value(loc, given, timed=True)
    if isinstance(value, Varying) and (value.table or set(list_names(value.expression)) & {"x", "y", "s"}):
        return 0.0, [Fault.at(loc, "a value that varies along a curve", "a number, or an expression of the time t")]
    return value or 0.0, faults


def _check_curves(
    case: Case, roles: Roles, bodies: Mapping[str, RigidBody], spreads: Mapping[str, Spread]
) -> Iterator[Fault]:
    """Every curve of what is rigid is an outer one, of one rigid body, without other conditions."""
    taken: dict[str, str] = {}
    for number, stage in enumerate(case.stages):
        for name in stage.tools:
            if name not in case.tools:
                yield unknown_name(("stages", number, "tools", name), name, "tool", case.tools)
    for body in bodies.values():
        if body.tool:
            continue  # see roles
        taken.setdefault(body.name, body.name)
        for index, name in enumerate(body.curves[1:]):
            loc = ("boundary", body.name, "rigid", "curves", index)
            if name not in roles.outer:
                yield (unknown_name(loc, name, "curve", roles.outer) if name not in case.curves else
                       Fault.at(loc, f"curve '{name}', which is no outer curve of one region", "an outer curve"))
            elif name in roles.in_contact:
                yield Fault.at(loc, f"curve '{name}', which is in contact '{roles.in_contact[name]}'", "a free curve")
            elif name in taken or name in case.boundary:
                yield Fault.at(loc, f"curve '{name}', which has conditions of its own",
                               "a curve that no other table [boundary.CURVE] is for, once")
            taken[name] = body.name
        yield from _check_regions(case, roles, body)
    yield from _check_stages(case, {**taken, **dict.fromkeys(spreads, "")})


def _check_regions(case: Case, roles: Roles, body: RigidBody) -> Iterator[Fault]:
    """A rigid body that joins regions is not taken apart."""
    regions = dict.fromkeys(roles.outer[name] for name in body.curves if name in roles.outer)
    for number, stage in enumerate(case.stages if len(regions) > 1 else ()):
        for name in regions:
            if name in stage.remove:
                yield Fault.at(("stages", number, "remove"), f"region '{name}', whose curves are in the rigid body of "
                               f"'{body.name}' with those of others", "regions that share no rigid body with others")


def _check_stages(case: Case, taken: Mapping[str, str]) -> Iterator[Fault]:
    """Stages say nothing else of curves that are rigid or have a resultant."""
    for number, stage in enumerate(case.stages):
        for name, table in stage.boundary.items():
            others = [key for key in type(table).model_fields if key not in ("rigid", "force")
                      and getattr(table, key) is not None]
            owner = taken.get(name, name)
            if name in taken and others:
                yield Fault.at(("stages", number, "boundary", name, others[0]), f"'{others[0]}' on a curve "
                               + ("whose traction has a given resultant" if not owner else f"of the rigid body of "
                                  f"'{owner}'"), "rigid or force, as in the curve's own table, or nothing")


def find_reference(body: RigidBody | Spread, curves: Mapping[str, Curve], origin: complex) -> complex:
    """The point of the moment, in the coordinates of the curves, which are about the user's point `origin`."""
    if body.about is not None:
        return body.about - origin
    names = body.curves if isinstance(body, RigidBody) else (body.curve,)
    points, weights = sample_curves(curves[name] for name in names)
    return points[0] + complex(weights @ (points - points[0])) / float(weights.sum())


def sample_curves(curves: Iterable[Curve]) -> tuple[Complex, Real]:
    """Points (k,) of curves and their weights of integration (k,)."""
    points, weights = [], []
    for curve in curves:
        for leg in curve.legs:
            points.append(leg.point(0.5 * (_NODES + 1)))
            weights.append(0.5 * _WEIGHTS * leg.length)
    return np.concatenate(points), np.concatenate(weights)


def unit_motions(points: Complex, about: complex) -> Complex:
    """Displacements (k, 3) of points by the unit motions along x, along y, and about a point (radians)."""
    return np.stack([np.ones_like(points), np.full_like(points, 1j), 1j * (points - about)], axis=1)


def find_tractions(spread: Spread, curves: Mapping[str, Curve], values: Values) -> tuple[Value, Value]:
    """tx and ty with the given resultant, for curves in the user's coordinates (theory, 92)."""
    about = find_reference(spread, curves, 0j)
    points, weights = sample_curves([curves[spread.curve]])
    motions = unit_motions(points, about)
    if not spread.linear:
        length = float(weights.sum())
        return _sum([(values[0], repr(1 / length))]), _sum([(values[1], repr(1 / length))])
    size = float(np.abs(points - about).max())
    scales = np.array([1.0, 1.0, 1 / size])
    gram = (weights[:, None, None] * (np.conj(motions)[:, :, None] * motions[:, None, :]).real).sum(axis=0)
    inverse = scales[:, None] * np.linalg.inv(scales[:, None] * gram * scales) * scales
    x, y = (f"({axis} - ({float(part)!r}))" for axis, part in zip("xy", (about.real, about.imag), strict=True))

    def combine(row: int, turned: str) -> Value:
        return _sum([
            (values[k], f"({float(inverse[row, k])!r} {turned}*({float(inverse[2, k])!r}))") for k in range(3)
        ])

    return combine(0, f"- {y}"), combine(1, f"+ {x}")


def _sum(terms: Sequence[tuple[Value, str]]) -> Value:
    """Sum of values times the numbers or expressions of places that are written beside them."""
    given = [(value, factor) for value, factor in terms if value]
    if all(not isinstance(value, Varying) for value, _ in given) and all("(" not in factor for _, factor in given):
        return float(sum(value * float(factor) for value, factor in given if not isinstance(value, Varying)))
    return Varying(" + ".join(
        f"({value.expression if isinstance(value, Varying) else repr(value)})*{factor}" for value, factor in given
    ))
