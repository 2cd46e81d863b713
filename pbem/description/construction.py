"""Keys of a case for construction in stages and for press fits; parts of tables in `schema`."""

from __future__ import annotations

from pydantic import Field

from pbem.description.table import Table
from pbem.description.values import NotNegative, Text


class ConstructionTable(Table):
    """Changes of the structure in a stage."""

    remove: tuple[Text, ...] = Field(
        (), description="regions that are removed; the tractions on their interfaces are released in proportion over "
        "the steps of the stage",
    )
    open: tuple[Text, ...] = Field(
        (), description="interfaces, cracks and contacts that never touch from this stage on; their tractions are "
        "released in proportion over its steps",
    )
    close: tuple[Text, ...] = Field(
        (), description="interfaces, cracks and contacts that are bonded from this stage on, with the jump at its "
        "beginning",
    )
    release: tuple[Text, ...] = Field(
        (), description="interfaces, cracks and contacts closed or opened by earlier stages that follow their law again"
    )


class FitTable(Table):
    """The allowed overlap of the bodies of a contact."""

    overlap: NotNegative = Field(
        0.0, description="largest allowed overlap of the bodies as drawn, a length, as for a press fit; the first step "
        "pushes them apart",
    )
