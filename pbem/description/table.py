"""What all tables of a case file are."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class Table(BaseModel):
    """A table of the case file: frozen, and without keys beyond its own."""

    model_config = ConfigDict(extra="forbid", frozen=True)
