"""Names of interfaces as they are asked for: single ones, those of a pattern, or all pieces of a trace.

What crossings cut into t12.1, t12.2, ... is the trace t12; a piece that is cut again, as of an imported map to which a
crack is added, is t12.1.1, t12.1.2, ..., of the trace t12.1 and of the trace t12.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from fnmatch import fnmatchcase

from pbem.wording import list_names, suggest

NUMBERS = re.compile(r"(?:\.\d+)+")
PIECE = re.compile(r"(.+?)((?:\.\d+)+)\Z")


def name_trace(name: str) -> str:
    """The trace that a piece belongs to, or a piece of a piece; another name belongs to itself."""
    found = PIECE.match(name)
    return found[1] if found else name


def is_piece(name: str, trace: str) -> bool:
    """Whether a name is that of a piece of a trace, or of a piece of one."""
    return name.startswith(trace) and NUMBERS.fullmatch(name, len(trace)) is not None


def number_piece(name: str) -> tuple[int, ...]:
    """Its place along its trace: pieces of one trace are in its order if they are in that of these numbers."""
    found = PIECE.match(name)
    return tuple(map(int, found[2].split(".")[1:])) if found else ()


def find_names(asked: Iterable[str], known: Sequence[str]) -> dict[str, list[str]]:
    """Of each name that is asked for the known ones that it stands for, in their order.

    Raises ValueError with all that stand for nothing, each with a near miss.
    """
    there = set(known)
    found, faults = {}, []
    for name in asked:
        chosen = [name] if name in there else (
            [each for each in known if is_piece(each, name)] or [each for each in known if fnmatchcase(each, name)]
        )
        if chosen:
            found[name] = chosen
        else:
            faults.append(f"there is no interface or crack '{name}'{suggest(name, [*known, *map(name_trace, known)])}")
    if faults:
        raise ValueError("; ".join([*faults, f"there are: {list_names(known) or 'none'}"]))
    return found
