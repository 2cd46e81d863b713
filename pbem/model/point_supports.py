"""Points of boundaries whose displacement is said where nothing else determines it.

In a plane body a force at a point moves that point without bound, so that a point can carry none. Supports therefore
choose the rigid motion of bodies whose loads balance, and nothing else: there have to be motions that are free, each
of which at most one condition determines.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from pbem.description.case import Case
from pbem.errors import Fault
from pbem.geometry.curve import Curve
from pbem.geometry.intersection import project
from pbem.geometry.junction import format_point
from pbem.model.roles import Roles, unknown_name

# A point lies on a curve that is nearer than this part of the curve's length.
ON_CURVE = 1e-6

Shift = tuple[float, float]


@dataclass(frozen=True)
class PointSupport:
    """place: a point (complex) of boundaries; held: whether its displacement along x and along y is said.

    owners: every region with the point on its boundary, and the curve of it, the nearest one first. Where these can
    move against each other the support is that of the first one that is free to move (see pbem.model.support_motions).
    """

    name: str
    owners: tuple[tuple[str, str], ...]
    place: complex
    held: tuple[bool, bool]

    @property
    def curve(self) -> str:
        """The nearest curve."""
        return self.owners[0][1]

    def move(self, shift: complex) -> PointSupport:
        """The same about another origin: the places of the model have become less by the shift."""
        return replace(self, place=self.place - shift)


def read_support_values(case: Case) -> tuple[tuple[Mapping[str, Shift], ...], list[Fault]]:
    """Displacements along x and y (0 where they are free) at the end of every stage; what a stage leaves out stays."""
    values = {name: (table.ux or 0.0, table.uy or 0.0) for name, table in case.point_supports.items()}
    faults: list[Fault] = []
    stages = []
    for number, stage in enumerate(case.stages):
        for name, table in stage.point_supports.items():
            loc = ("stages", number, "point_supports", name)
            if name not in values:
                faults.append(unknown_name(loc, name, "point support", case.point_supports))
                continue
            for key in table.model_fields_set:
                if getattr(case.point_supports[name], key) is None:
                    faults.append(Fault.at((*loc, key), f"'{key}' for the first time in a stage",
                                           f"its value in [point_supports.{name}] too (0 holds the point)"))
            x, y = (before if getattr(table, key) is None else getattr(table, key)
                    for key, before in zip(("ux", "uy"), values[name], strict=True))
            values[name] = (x, y)
        stages.append(dict(values))
    return tuple(stages or [values]), faults


def place_point_supports(
    case: Case, roles: Roles, curves: Mapping[str, Curve]
) -> tuple[dict[str, PointSupport], list[Fault]]:
    """Curves and regions of the supports; faults for those that lie on none, and for names of two things."""
    supports: dict[str, PointSupport] = {}
    faults: list[Fault] = []
    sides = {**roles.shared, **{curve: (region,) for curve, region in roles.outer.items()}}
    for name, table in case.point_supports.items():
        loc, point = ("point_supports", name), complex(*table.at)
        if name in case.curves:
            faults.append(Fault.at(loc, f"the name '{name}', which is that of a curve",
                                   "a name of its own, under which reactions are stored"))
        if table.ux is None and table.uy is None:
            faults.append(Fault.at(loc, "a support without ux and uy", "ux, uy or both"))
            continue
        near = sorted(((*project(leg, point)[::-1], curve.name, leg) for curve in curves.values() for leg in curve.legs
                       if curve.name in sides), key=lambda each: each[0])
        if not near or near[0][0] > ON_CURVE * curves[near[0][2]].length:
            said = f", {near[0][0]:.3g} from the nearest curve '{near[0][2]}'" if near else ""
            faults.append(Fault.at((*loc, "at"), f"{format_point(point)}{said}", "a point on the boundary of a region"))
            continue
        owners: dict[str, str] = {}
        for away, _, curve, _ in near:
            for region in sides[curve] if away <= ON_CURVE * curves[curve].length else ():
                owners.setdefault(region, curve)
        _, at, _, leg = near[0]
        supports[name] = PointSupport(name, tuple(owners.items()), complex(leg.point(np.array(at))),
                                      (table.ux is not None, table.uy is not None))
    return supports, faults
