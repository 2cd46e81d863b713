"""What all tables of a case file are."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field

from pbem.description.values import Text


class Table(BaseModel):
    """A table of the case file: frozen, and without keys beyond its own."""

    # Validators of tables within others are never used by themselves: building them all took a tenth of a start.
    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)


class UnitsTable(Table):
    """Labels for pictures and results. No values are converted; use any consistent units."""

    length: Text = Field("", description="label of the unit of length")
    stress: Text = Field("", description="label of the unit of stress")
