"""The tables of a case file about what stays rigid, and about tractions with a given resultant."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from pbem.description.table import Table
from pbem.description.values import Point, Text
from pbem.description.varying import Value


class StageRigidTable(Table):
    """Force and moment on what stays rigid, or how it moves, at the end of the stage. May depend on the time `t`."""

    fx: Value | None = Field(None, description="force along x on it, stress times length, as per unit thickness")
    fy: Value | None = Field(None, description="force along y")
    moment: Value | None = Field(None, description="moment about `about`, counter-clockwise, stress times length^2")
    ux: Value | None = Field(None, description="or displacement of the point `about` along x")
    uy: Value | None = Field(None, description="or along y")
    rotation: Value | None = Field(None, description="or rotation, degrees, counter-clockwise; it is taken as small")


class RigidTable(StageRigidTable):
    """What stays rigid: per direction a force or a motion is given; where neither is, the force is zero."""

    about: Point | None = Field(
        None, description="point of the moment and of the displacements; by default the centroid of its curves"
    )
    curves: tuple[Text, ...] = Field((), description="further curves that move with it as one rigid body")


class StageForceTable(Table):
    """Resultant of a traction at the end of the stage. May depend on the time `t`."""

    fx: Value | None = Field(None, description="force along x, stress times length, as per unit thickness")
    fy: Value | None = Field(None, description="force along y")
    moment: Value | None = Field(
        None, description='moment about `about`, counter-clockwise; with `how = "linear"` only'
    )


class ForceTable(StageForceTable):
    """A force and a moment that are spread over a curve as a traction."""

    about: Point | None = Field(None, description="point of the moment; by default the curve's centroid")
    how: Literal["uniform", "linear"] = Field(
        "uniform", description="the traction is the same everywhere, or linear in x and y, with that moment"
    )


class ToolTable(RigidTable):
    """A rigid tool: a curve that bounds no region, with a shape that never changes. It acts on bodies by `[contacts]`
    in which it is one of the two curves. Per direction a force or a motion is given; where neither is, the force is
    zero."""
