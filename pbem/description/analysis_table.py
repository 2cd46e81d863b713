"""The keys of `[analysis]`."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from pbem.description.table import Table
from pbem.description.values import Count, Flag, Part


class AnalysisTable(Table):
    """Choice of equations, elements and load steps."""

    scheme: Literal["SST", "DBEM", "HST", "THST"] = Field(
        "SST",
        description='the integral equation collocated on each face. `"SST"`: displacement everywhere; `"DBEM"`: '
        'traction on the second side of contacts; `"HST"`: traction on both sides; `"THST"`: traction everywhere. '
        "Elements at corners and ends of contact, and opposite a contact's blunt corners, keep the displacement "
        "equation; so do faces beside cracks and narrow slots and, with DBEM and HST, parts of a contact's curves "
        "without an opposite face. Cracks always have the dual pair; narrow slots keep the displacement equation on "
        "one face",
    )
    order: Annotated[int, Field(strict=True, ge=0, le=3)] = Field(2, description="polynomial order of an element")
    tips: Flag = Field(True, description="crack-tip elements with square-root shapes")
    steps: Count = Field(10, description="number of load steps; without effect if there are `[[stages]]`")
    accuracy: Part | None = Field(
        None,
        description="refine and solve again until twice the estimated relative errors of reactions, of slips and "
        "openings, and of K are below this value at every stored step; see `pbem help accuracy`",
    )
    grade_contact_ends: Literal["auto"] | Flag = Field(
        "auto",
        description="where contact of rounded faces ends within an element that is too long for the fall of the "
        "pressure there, shorten the elements of both curves towards that end and solve again; contacts one "
        'of whose curves has a `grading` other than `"auto"` are left as they are; `"auto"`: not beside `accuracy`, '
        "nor in large models and sweeps, nor on curves that two regions share; see `pbem help accuracy`",
    )
