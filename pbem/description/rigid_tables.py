"""The tables of a case file for rigid curves and tools, and for tractions with a given resultant."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from pbem.description.table import Table
from pbem.description.values import Point, Text
from pbem.description.varying import Value


class StageRigidTable(Table):
    """Force and moment on a rigid curve or tool, or its motion, at the end of the stage. May depend on the time `t`."""

    fx: Value | None = Field(None, description="force along x, per unit thickness (stress times length)")
    fy: Value | None = Field(None, description="force along y")
    moment: Value | None = Field(None, description="moment about `about`, counter-clockwise, stress times length^2")
    ux: Value | None = Field(None, description="or displacement of the point `about` along x")
    uy: Value | None = Field(None, description="or along y")
    rotation: Value | None = Field(None, description="or rotation, degrees, counter-clockwise; it must be small")


class RigidTable(StageRigidTable):
    """A rigid curve: in each direction a force or a motion is given; if neither is, the force is zero."""

    about: Point | None = Field(
        None, description="reference point of the moment and the displacements; by default the centroid of its curves"
    )
    curves: tuple[Text, ...] = Field((), description="further curves that move with it as one rigid body")


class StageForceTable(Table):
    """Resultant of a traction at the end of the stage. May depend on the time `t`."""

    fx: Value | None = Field(None, description="force along x, per unit thickness (stress times length)")
    fy: Value | None = Field(None, description="force along y")
    moment: Value | None = Field(
        None, description='moment about `about`, counter-clockwise; with `how = "linear"` only'
    )


class ForceTable(StageForceTable):
    """A force and a moment distributed over a curve as a traction."""

    about: Point | None = Field(None, description="reference point of the moment; by default the centroid of the curve")
    how: Literal["uniform", "linear"] = Field(
        "uniform", description="the traction is uniform, or linear in x and y with the given moment"
    )


class ToolTable(RigidTable):
    """A rigid tool: a curve of fixed shape that bounds no region. It acts on bodies through `[contacts]` in which it is
    one of the two curves. In each direction a force or a motion is given; if neither is, the force is zero."""
