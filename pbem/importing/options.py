"""What the command line asks of an import."""

from __future__ import annotations

from dataclasses import dataclass

FRICTION, YOUNG, POISSON = 0.6, 1000.0, 0.2


@dataclass(frozen=True)
class Options:
    """Numbers of the command `pbem import`; None where none is given.

    size: largest length of elements; snap: points no further apart are one; simplify: distance that a simplified line
    may be off the one of the file; keep_junctions: whether it is simplified between junctions, which stay; stresses:
    sxx, syy, sxy far away.
    """

    size: float | None = None
    snap: float | None = None
    simplify: float | None = None
    friction: float | None = None
    young: float | None = None
    poisson: float | None = None
    sxx: float | None = None
    syy: float | None = None
    sxy: float | None = None
    keep_junctions: bool = False


@dataclass(frozen=True)
class Imported:
    """A case, and what is said of it.

    text: of the file; summary: lines that say what it holds; notes: sentences, the defaults that were taken among them;
    changes: one line for each thing that was joined, cut, dropped or moved, by kind.
    """

    text: str
    summary: tuple[str, ...]
    notes: tuple[str, ...]
    changes: tuple[tuple[str, tuple[str, ...]], ...]
