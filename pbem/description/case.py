"""A case that was found valid."""

from __future__ import annotations

from collections.abc import Mapping

from pydantic import PrivateAttr

from pbem.description.generation import Group
from pbem.description.places import Loc, find_line, format_place
from pbem.description.schema import CaseFile
from pbem.errors import Fault


class Case(CaseFile):
    """A case file that was read and found valid. `text`: the whole file; `source`: its path, as given.

    Curves, regions and laws of the tables [[generate]] are among those of the file, after them.
    """

    text: str
    source: str
    _lines: Mapping[Loc, int] = PrivateAttr(default_factory=dict)
    _groups: tuple[Group, ...] = PrivateAttr(default=())
    _origin: Mapping[str, int] = PrivateAttr(default_factory=dict)

    @property
    def groups(self) -> tuple[Group, ...]:
        """What the tables [[generate]] made."""
        return self._groups

    def fault(self, loc: Loc, found: str, expected: str) -> Fault:
        """A fault with its place: `loc` is the path of a key, entries of lists from 0."""
        place = self._find_written(loc)
        return Fault(format_place(place, find_line(self._lines, place)), found, expected)

    def _find_written(self, loc: Loc) -> Loc:
        """The path itself, or of a curve, region or law that was generated, that of the key that it was made from."""
        if len(loc) == 4 and loc[0] == "regions" and isinstance(loc[3], int):  # a name in a list
            names = getattr(self.regions.get(str(loc[1])), str(loc[2]), ())
            if loc[3] < len(names) and names[loc[3]] in self._origin:
                return ("generate", self._origin[names[loc[3]]])
        if loc[:2] in self._lines:
            return loc
        if len(loc) < 2 or loc[0] not in ("curves", "regions", "interfaces") or loc[1] not in self._origin:
            return loc
        place = ("generate", self._origin[str(loc[1])])
        return (*place, loc[2]) if len(loc) > 2 and (*place, loc[2]) in self._lines else place
