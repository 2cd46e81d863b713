"""A case (of `pbem.description.case`) in a few lines, as a console prints it, and as a small table for notebooks."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from typing import Any

from pbem.errors import printable
from pbem.wording import count, list_names

MOST_NAMES = 8
MOST_LETTERS = 100


def summarise(case: Any) -> list[tuple[str, str]]:
    """What there is, by kind: the names, with laws, and how many steps."""
    made = {name for group in case.groups for name in group.members}

    def name_own(table: Mapping[str, object]) -> list[str]:
        return [name for name in table if name not in made]

    laws = [f"{name} ({case.interfaces[name].law})" if case.interfaces[name].law else name
            for name in name_own(case.interfaces)]
    stages = [f"{stage.name or 'stage'} ({count(stage.steps, 'step')})" for stage in case.stages]
    rows: list[tuple[str, Sequence[str]]] = [
        ("materials", list(case.materials)),
        ("generated", [f"{group.count} {group.kind} {group.name}" for group in case.groups]),
        ("curves", name_own(case.curves)),
        ("regions", name_own(case.regions)),
        ("conditions", list(case.boundary)),
        ("interfaces", laws),
        ("contacts", [f"{name} ({' and '.join(table.between)})" for name, table in case.contacts.items()]),
        ("tools", list(case.tools)),
        ("stages", stages or [count(case.analysis.steps, "step")]),
        ("analysis", [f"{case.analysis.scheme}, order {case.analysis.order}"]),
    ]
    return [(label, _shorten(list_names(names, MOST_NAMES))) for label, names in rows if names]


def _shorten(text: str) -> str:
    text = printable(text)
    return text if len(text) <= MOST_LETTERS else text[: MOST_LETTERS - 4] + " ..."


def print_case(case: Any) -> str:
    """The title, and a line for each kind of thing."""
    rows = summarise(case)
    width = max(len(label) for label, _ in rows)
    title = _shorten(case.title) or "without a title"
    return "\n".join([f"<Case: {title}", *(f"  {label:{width}}  {text}" for label, text in rows)]) + ">"


def print_case_as_html(case: Any) -> str:
    """The same as a table."""
    rows = [f"<tr><th>{label}</th><td>{html.escape(text)}</td></tr>" for label, text in summarise(case)]
    title = html.escape(_shorten(case.title) or "without a title")
    return f"<table><caption>{title}</caption>{''.join(rows)}</table>"
