"""The traces that curves belong to: t12 of its pieces t12.1, t12.2, ..."""

from __future__ import annotations

import itertools
from collections.abc import Mapping

from pbem.description.case import Case
from pbem.description.families import find_families
from pbem.geometry.curve import Curve

# Part of their lengths by which curves may miss each other where one goes on in the next.
MISSED = 1e-9


def find_traces(case: Case, curves: Mapping[str, Curve]) -> dict[str, str]:
    """Of every curve that is a piece of a trace the name of that.

    Pieces are made by cuts, or are named together by a law or a stage; or they are written one by one, numbered from 1
    on, each with an end where the one before has one. Other curves of such names, as v1.2 and v1.3, are no pieces: they
    are cracks of their own. case: with the pieces of what was cut; curves: of these.
    """
    families = {**_find_written(case, curves), **case.families}
    wholes = {piece: whole for whole, pieces in families.items() for piece in pieces if piece != whole}
    found = {}
    for name in curves:
        whole = name
        while whole in wholes:
            whole = wholes[whole]
        if whole != name:
            found[name] = whole
    return found


def _find_written(case: Case, curves: Mapping[str, Curve]) -> dict[str, tuple[str, ...]]:
    """Pieces that go on in each other, by the name of their trace, which nothing else has."""
    cut = {name: pieces for name, pieces in case.families.items() if name in case.given.get("curves", ())}
    ends = {}
    for name in (*case.curves, *cut):
        parts = [curves[each] for each in cut.get(name, (name,)) if each in curves]
        if parts:
            ends[name] = (parts[0].start, parts[-1].end, sum(part.length for part in parts))
    stems = dict.fromkeys(stem for name in ends if (stem := name.rpartition(".")[0]))
    return {
        trace: pieces for trace, pieces in find_families([*stems], ends).items()
        if len(pieces) > 1 and pieces == tuple(f"{trace}.{number}" for number in range(1, len(pieces) + 1))
        and all(_meet(ends[a], ends[b]) for a, b in itertools.pairwise(pieces))
    }


def _meet(one: tuple[complex, complex, float], other: tuple[complex, complex, float]) -> bool:
    """Whether two curves, by start, end and length, have an end in common."""
    missed = MISSED * (one[2] + other[2])
    return min(abs(a - b) for a in one[:2] for b in other[:2]) <= missed
