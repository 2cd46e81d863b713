"""The case as users have it: made by calls, read from a file, written to one."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self

from pbem.case.changed import change_draft, label_key
from pbem.case.reader import parse_draft, read_case_text
from pbem.case.writer import write_tables
from pbem.description import case as description
from pbem.errors import CaseError


class Case(description.Case):
    """A valid case, with the tables and keys of a case file (`pbem help keys`) as arguments and attributes.

        Case(materials={"rock": {"young": 1000.0, "poisson": 0.2}}, curves={...}, regions={...})

    Raises CaseError with every fault of tables and keys; what follows from the geometry is checked when it is run.
    """

    _text: str | None = None

    @property
    def text(self) -> str:
        """The text of the file that it was read from, or of one with the same tables."""
        return write_tables(self.given) if self._text is None else self._text

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Self:
        """The case of a file. Raises CaseError with every fault of its tables and keys, each with its line."""
        return cls.parse(read_case_text(path), str(path))

    @classmethod
    def parse(cls, text: str, source: str = description.UNNAMED) -> Self:
        """The case of the text of a file; `source` names it in messages. Raises CaseError as `read` does."""
        draft = parse_draft(text, source)
        if draft.faults or draft.case is None:
            raise CaseError(source, draft.faults)
        return cls.take(draft.case, text)

    @classmethod
    def take(cls, case: description.Case, text: str) -> Self:
        """The same case with the text that it was read from."""
        same = cls.__new__(cls)
        same._take({**vars(case), "_text": text})
        return same

    def replace(self, changes: Mapping[str, Any]) -> Self:
        """A new case with values set by the paths of their keys; everything is checked again.

            case.replace({"interfaces.seat.friction": 0.3, "curves.*.elements": 16, "stages.shear.steps": 40})

        Paths are written as TOML's dotted keys: a name with dots stands in quotes. *, ? and [abc] in a name mean what
        they mean in the shell, but for names in single quotes; a pattern stands for what is there, and cracks without
        a law of their own. Entries of lists are numbered from 0; stages and generate also go by name. None takes a key
        away. Setting one of friction and friction_angle, or of elements and size, takes the other away; any other
        conflict is a fault, as in a file. Raises CaseError with every fault: unknown keys and names with the nearest.
        """
        draft = change_draft(description.Draft(self, ()), changes, label_key)
        if draft.faults or draft.case is None:
            raise CaseError(self.source, draft.faults)
        same = type(self).__new__(type(self))
        same._take(vars(draft.case))
        return same

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write a case file that reads back to the same case. Paths of laws' files are written as they were given."""
        Path(path).write_text(self.text, encoding="utf-8")


def read_case(path: str | os.PathLike[str]) -> Case:
    """Read and validate a case file.

    Raises CaseError with every fault of the file's tables and keys; what follows from the topology is checked by
    `pbem.model.build.build_model`.
    """
    return Case.read(path)


def parse_case(text: str, source: str = description.UNNAMED) -> Case:
    """Validate the text of a case file; `source` names it in messages. Raises CaseError with every fault."""
    return Case.parse(text, source)
