"""The records of many runs as a table by kind, and the lines of what went wrong."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from .runs import NAMED_REASONS, Record, compare


def format_table(records: Sequence[Record]) -> str:
    """One row for each kind and one for all: of the runs in their own units on one rank."""
    base = [record for record in records if record.variant == 0 and record.ranks == 1]
    kinds = list(dict.fromkeys(record.kind for record in base))
    pairs = _pair(records)
    head = (
        "kind     models settled named failed faulty  median  90 %  most halved   contact  balance   energy  "
        "    units     ranks      s"
    )
    lines = [head]
    for kind in (*kinds, "all"):
        own = [record for record in base if kind in (record.kind, "all")]
        lines.append(_format_row(kind, own, [pair for pair in pairs if kind in (pair[0].kind, "all")]))
    ends = Counter((record.status, record.verdict) for record in base if record.status != "settled")
    lines += [f"  {count} x {status}: {verdict or 'not judged'}" for (status, verdict), count in ends.most_common()]
    return "\n".join(lines)


def _format_row(kind: str, own: Sequence[Record], pairs: Sequence[tuple[Record, Record]]) -> str:
    settled = [record for record in own if record.status == "settled"]
    named = sum(record.status in NAMED_REASONS for record in own)
    faulty = sum(bool(record.faults) for record in settled)
    counts = np.array([number for record in settled for number in record.iterations] or [0])
    contact = max((value for record in settled for value in record.contact.values()), default=0.0)
    balance, energy = (max((getattr(record, key) for record in settled), default=0.0) for key in ("balance", "energy"))
    units, ranks = (
        [not compare(*pair) for pair in pairs if (pair[1].ranks > 1) == several] for several in (False, True)
    )
    seconds = sum(record.seconds for record in own)
    return (
        f"{kind:8s} {len(own):6d} {len(settled):7d} {named:5d} {len(own) - len(settled) - named:6d} {faulty:6d}  "
        f"{np.median(counts):6.0f} {np.percentile(counts, 90):5.0f} {counts.max():5d} "
        f"{sum(record.halved for record in own):6d}  {contact:8.1e} {balance:8.1e} {energy:8.1e}  "
        f"{sum(units):4d}/{len(units):<4d} {sum(ranks):4d}/{len(ranks):<4d} {seconds:6.0f}"
    )


def _pair(records: Sequence[Record]) -> list[tuple[Record, Record]]:
    """Each run in other units or on other ranks with the one that it should equal."""
    first = {record.seed: record for record in records if record.variant == 0 and record.ranks == 1}
    return [
        (first[record.seed], record)
        for record in records
        if record.seed in first and (record.variant > 0 or record.ranks > 1)
    ]


def list_faults(records: Sequence[Record]) -> list[str]:
    """A line for each run that failed, is faulty, or differs from itself in other units or on other ranks."""
    lines = []
    for record in sorted(records, key=lambda each: (each.seed, each.ranks, each.variant)):
        where = f"seed {record.seed} {record.kind}" + (f" on {record.ranks} ranks" if record.ranks > 1 else "")
        where += f" in units {record.variant}" if record.variant else ""
        lines += [f"{where}: {fault}; {record.detail}".rstrip("; ") for fault in record.faults]
    lines += [
        f"seed {first.seed} {first.kind}: differs "
        + (f"on {other.ranks} ranks" if other.ranks > 1 else f"in units {other.variant}")
        + f": {text}"
        for first, other in _pair(records)
        if (text := compare(first, other))
    ]
    return lines


def has_failed(records: Sequence[Record]) -> bool:
    """Whether anything went wrong."""
    return bool(list_faults(records))
