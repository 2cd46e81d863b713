"""Keys of a case that say what is built, taken away or pressed into each other; parts of tables in `schema`."""

from __future__ import annotations

from pydantic import Field

from pbem.description.table import Table
from pbem.description.values import NotNegative, Text


class ConstructionTable(Table):
    """What a stage changes of what there is."""

    remove: tuple[Text, ...] = Field(
        (), description="regions that are taken away; what they carried on their interfaces is released in proportion "
        "over the steps of the stage",
    )
    open: tuple[Text, ...] = Field(
        (), description="interfaces, cracks and contacts that never touch from this stage on; what they carried is "
        "released in proportion over its steps",
    )
    close: tuple[Text, ...] = Field(
        (), description="interfaces, cracks and contacts that are bonded from this stage on, as they lie at its "
        "beginning",
    )
    release: tuple[Text, ...] = Field(
        (), description="of what stages before have closed or opened: from this stage on it follows its law"
    )


class FitTable(Table):
    """How far the bodies of a contact may lie in each other."""

    overlap: NotNegative = Field(
        0.0, description="length by which the bodies may lie in each other as they are drawn, at most, as for a press "
        "fit; the first step drives them apart",
    )
