"""Keys of the case file that the program knows and cannot compute yet; each is lifted by removing its line."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from pbem.case.finding import Finding
from pbem.case.places import Loc


def _given(value: object) -> bool:
    return True


@dataclass(frozen=True)
class Refusal:
    """A key (``*`` stands for any name) that is refused when its value is as `when` says.

    separable: the rest of the file can be judged as if the key were not there.
    """

    path: str
    what: str
    when: Callable[[object], bool] = _given
    separable: bool = True


REFUSALS = (
    Refusal("contacts", "contact between different curves", separable=False),
    Refusal("stages.*.contacts", "contact between different curves"),
    Refusal("output.interior", "output at interior points"),
    Refusal("output.points", "output at interior points"),
)


def find_refusals(raw: Mapping[str, Any]) -> list[tuple[Refusal, Finding]]:
    """One finding for every key of the file that is not yet supported."""
    return [
        (refusal, Finding(loc, refusal.what, f"a file without `{loc[-1]}` here: not yet supported"))
        for refusal in REFUSALS
        for loc, value in _match(raw, refusal.path.split("."), ())
        if refusal.when(value)
    ]


def _match(value: Any, path: list[str], loc: Loc) -> Iterator[tuple[Loc, Any]]:
    if not path:
        yield loc, value
        return
    entries: list[tuple[str | int, Any]] = []
    if isinstance(value, dict):
        entries = [(key, entry) for key, entry in value.items() if path[0] in ("*", key)]
    elif isinstance(value, list) and path[0] == "*":
        entries = list(enumerate(value))
    for key, entry in entries:
        yield from _match(entry, path[1:], (*loc, key))
