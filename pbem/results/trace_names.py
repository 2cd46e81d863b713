"""Names of interfaces as they are asked for: single ones, those of a pattern, or all pieces of a trace.

What crossings cut into t12.1, t12.2, ... is the trace t12; a piece that is cut again, as of an imported map to which a
crack is added, is t12.1.1, t12.1.2, ..., of the trace t12.1 and of the trace t12. Curves that a user calls v1.2 and
v1.3 are no pieces of a trace v1, unless a law or a stage names that (see pbem.model.traces).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from fnmatch import fnmatchcase

from pbem.wording import list_names, suggest

NUMBERS = re.compile(r"(?:\.\d+)+")
PIECE = re.compile(r"(.+?)((?:\.\d+)+)\Z")


def name_trace(name: str) -> str:
    """The trace that a piece, or a piece of a piece, seems to belong to by its name; another name belongs to itself."""
    found = PIECE.match(name)
    return found[1] if found else name


def is_piece(name: str, trace: str) -> bool:
    """Whether a name is that of a piece of a trace, or of a piece of one."""
    return name.startswith(trace) and NUMBERS.fullmatch(name, len(trace)) is not None


def list_pieces(trace: str, known: Iterable[str], traces: Mapping[str, str]) -> list[str]:
    """Of the known names those of pieces of a trace, or of a part of one that was cut again; traces: the trace of each.

    Where there are none, curves that are called like pieces and are whole: to ask for v1 is to ask for v1.2 and v1.3.
    """
    own = {each: traces.get(each, each) for each in known if is_piece(each, trace)}
    pieces = [each for each, whole in own.items() if trace == whole or is_piece(trace, whole)]
    return pieces or [each for each, whole in own.items() if each == whole]


def number_piece(name: str) -> tuple[int, ...]:
    """Its place along its trace: pieces of one trace are in its order if they are in that of these numbers."""
    found = PIECE.match(name)
    return tuple(map(int, found[2].split(".")[1:])) if found else ()


def find_names(
    asked: Iterable[str], known: Sequence[str], traces: Mapping[str, str] | None = None
) -> dict[str, list[str]]:
    """Of each name that is asked for the known ones that it stands for, in their order. traces: see `list_pieces`.

    Raises ValueError with all that stand for nothing, each with a near miss.
    """
    there, traces = set(known), traces or {}
    found, faults = {}, []
    for name in asked:
        chosen = [name] if name in there else (
            list_pieces(name, known, traces) or [each for each in known if fnmatchcase(each, name)]
        )
        if chosen:
            found[name] = chosen
        else:
            near = suggest(name, [*known, *(traces.get(each) or name_trace(each) for each in known)])
            faults.append(f"there is no interface or crack '{name}'{near}")
    if faults:
        raise ValueError("; ".join([*faults, f"there are: {list_names(known) or 'none'}"]))
    return found
