"""The case as users see it: made in Python, read from a file, or written to one."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self

from pbem.bundled import locate
from pbem.case.changed import change_draft, label_key
from pbem.case.reader import parse_draft, read_case_text
from pbem.case.writer import write_tables
from pbem.description import case as description
from pbem.errors import CaseError, PbemError


class Case(description.Case):
    """A valid case, with the tables and keys of a case file (`pbem help keys`) as arguments and attributes.

        Case(materials={"rock": {"young": 1000.0, "poisson": 0.2}}, curves={...}, regions={...})

    Raises CaseError with all faults of tables and keys; what depends on the geometry is checked when the case is run.
    """

    _text: str | None = None

    @property
    def text(self) -> str:
        """The text of the file it was read from, or of a file with the same tables."""
        return write_tables(self.given) if self._text is None else self._text

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Self:
        """Read a case file, or a case of the program by its name. Raises CaseError with all faults of its tables and
        keys, each with its line."""
        file = locate(path)
        return cls.parse(read_case_text(file), str(file))

    @classmethod
    def parse(cls, text: str, source: str = description.UNNAMED) -> Self:
        """Parse the text of a case file; `source` is its name in messages. Raises CaseError as `read` does."""
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
        """Return a new case with values set by the paths of their keys. The new case is validated.

            case.replace({"interfaces.seat.friction": 0.3, "curves.*.elements": 16, "stages.shear.steps": 40})

        Paths are written like TOML's dotted keys; a name that contains dots must be quoted. *, ? and [abc] in a name
        are patterns as in the shell, except in single quotes; a pattern matches existing names, and cracks for which no
        law was given. Entries of lists are numbered from 0; stages and generate can also be addressed by name. None
        removes a key. friction and friction_angle replace each other, and so do elements and size; any other conflict
        is a fault, as in a file. Raises CaseError with all faults; unknown keys and names with the closest known one.
        """
        draft = change_draft(description.Draft(self, ()), changes, label_key)
        if draft.faults or draft.case is None:
            raise CaseError(self.source, draft.faults)
        same = type(self).__new__(type(self))
        same._take(vars(draft.case))
        return same

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write a case file that reads back to the same case. Paths of files of custom laws are written as given.

        Raises PbemError if it cannot be written there.
        """
        try:
            Path(path).write_text(self.text, encoding="utf-8")
        except OSError as error:
            raise PbemError(f"{path}: cannot be written ({error.strerror or error}); expected the path of a file in a "
                            "folder that is there") from None


def read_case(path: str | os.PathLike[str]) -> Case:
    """Read and validate a case file.

    Raises CaseError with all faults of its tables and keys; what depends on the geometry is checked by
    `pbem.model.build.build_model`.
    """
    return Case.read(path)


def parse_case(text: str, source: str = description.UNNAMED) -> Case:
    """Validate the text of a case file; `source` is its name in messages. Raises CaseError with all faults."""
    return Case.parse(text, source)
