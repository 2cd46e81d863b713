"""Names of interfaces as they are asked for: single ones, those of a pattern, or all pieces of a trace.

What crossings cut into t12.1, t12.2, ... is the trace t12.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from fnmatch import fnmatchcase

from pbem.wording import list_names, suggest

PIECE = re.compile(r"(.+)\.\d+\Z")


def name_trace(name: str) -> str:
    """The trace that a piece belongs to; another name belongs to itself."""
    found = PIECE.match(name)
    return found[1] if found else name


def is_piece(name: str, trace: str) -> bool:
    """Whether a name is that of a piece of a trace."""
    return name != trace and name_trace(name) == trace


def number_piece(name: str) -> int:
    """The number of a piece along its trace."""
    return int(name.rpartition(".")[2])


def find_names(asked: Iterable[str], known: Sequence[str]) -> dict[str, list[str]]:
    """Of each name that is asked for the known ones that it stands for, in their order.

    Raises ValueError with all that stand for nothing, each with a near miss.
    """
    by_trace: dict[str, list[str]] = {}
    for name in known:
        by_trace.setdefault(name_trace(name), []).append(name)
    there = set(known)
    found, faults = {}, []
    for name in asked:
        chosen = [name] if name in there else by_trace.get(name) or [each for each in known if fnmatchcase(each, name)]
        if chosen:
            found[name] = chosen
        else:
            faults.append(f"there is no interface or crack '{name}'{suggest(name, [*known, *by_trace])}")
    if faults:
        raise ValueError("; ".join([*faults, f"there are: {list_names(known) or 'none'}"]))
    return found
