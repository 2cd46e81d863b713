"""A fault before it has its line number."""

from __future__ import annotations

from dataclasses import dataclass

from pbem.errors import KeyPath


@dataclass(frozen=True)
class Finding:
    """loc: path of the key (list entries from 0); found and expected as in `pbem.errors.Fault`."""

    loc: KeyPath
    found: str
    expected: str
