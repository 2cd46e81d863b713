"""Tables of what acts within regions: stress far away and at rest, weight, strain without stress, and single points."""

from __future__ import annotations

from pydantic import Field

from pbem.description.table import Table
from pbem.description.values import Number, Point
from pbem.description.varying import LinearValue


class RemoteTable(Table):
    """Components of the stress at infinity."""

    sxx: LinearValue = 0.0
    syy: LinearValue = 0.0
    sxy: LinearValue = 0.0


class InSituTable(Table):
    """Components of the in-situ stress."""

    sxx: LinearValue = 0.0
    syy: LinearValue = 0.0
    sxy: LinearValue = 0.0


class EigenstrainTable(Table):
    """Components of the stress-free strain of a region."""

    exx: LinearValue = 0.0
    eyy: LinearValue = 0.0
    exy: LinearValue = Field(0.0, description="shear component of the tensor, half the engineering shear strain")
    ezz: LinearValue = Field(0.0, description="strain normal to the plane; without effect in plane stress")


class PointForceTable(Table):
    """Force and moment at a point, per thickness."""

    fx: Number = Field(0.0, description="force along x")
    fy: Number = Field(0.0, description="force along y")
    moment: Number = Field(0.0, description="moment, counter-clockwise; inside regions only")


class PointLoadTable(PointForceTable):
    """A force at a point inside a region or on the boundary of one."""

    at: Point = Field(description="x, y of the point")


class PointShiftTable(Table):
    """Displacement of a point."""

    ux: Number | None = Field(None, description="displacement along x")
    uy: Number | None = Field(None, description="displacement along y")


class PointSupportTable(PointShiftTable):
    """A point of a boundary with a given displacement."""

    at: Point = Field(description="x, y of the point")


class GravityTable(Table):
    """Acceleration; a region's weight per volume is its density times this."""

    gx: Number = 0.0
    gy: Number = 0.0
