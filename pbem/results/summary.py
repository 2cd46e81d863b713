"""Results in a few lines, as Python and notebooks show them."""

from __future__ import annotations

from html import escape

import numpy as np

from pbem.errors import printable
from pbem.results.reader import Results
from pbem.wording import list_names

MOST_NAMES = 6


def list_facts(results: Results) -> list[tuple[str, str]]:
    """What a result file holds: pairs of a word and its text."""
    steps = results.steps
    reached = "none"
    if len(steps):
        stage = steps.stage_names[int(steps.stage[-1])]
        reached = f"{len(steps)} stored, the last number {steps.number[-1]} ({stage}, factor {steps.factor[-1]:.4g})"
    size = f"{len(results.nodes.position)} nodes, {len(results.elements.vertices)} elements"
    facts = [
        ("title", results.title), ("file", str(results.path)),
        ("status", results.status + (f": {results.failure}" if results.failure else "")), ("steps", reached),
        ("size", size), ("regions", list_names(results.nodes.region_names, MOST_NAMES)),
        ("contact", list_names(results.contact, MOST_NAMES)), ("tips", list_names(results.tips, MOST_NAMES)),
        ("reactions", list_names(results.reactions, MOST_NAMES)),
        ("rigid", list_names(results.rigid, MOST_NAMES)),
        ("interior", "" if results.interior is None else f"{len(results.interior.position)} points"),
    ]
    return [(name, printable(text)) for name, text in facts if text]


def summarise(results: Results) -> str:
    """A few lines."""
    return "\n".join(["<pbem results", *(f"  {name + ':':11s}{text}" for name, text in list_facts(results))]) + ">"


def summarise_html(results: Results) -> str:
    """A small table, and below it the contact at the last step."""
    rows = "".join(f"<tr><th style='text-align:left'>{escape(name)}</th><td style='text-align:left'>{escape(text)}</td>"
                   "</tr>" for name, text in list_facts(results))
    return f"<table>{rows}</table>{_list_contact(results)}"


def _list_contact(results: Results) -> str:
    names = list(results.contact)[:MOST_NAMES]
    if not names or not len(results.steps):
        return ""
    titles = ("interface", "stick", "slip", "open", "max opening", "max |slip|")
    lines = ["".join(f"<th>{title}</th>" for title in titles)]
    for name in names:
        contact = results.contact[name]
        counts = np.bincount(contact.mode[-1], minlength=3)
        largest = (contact.opening[-1].max(initial=0.0), np.abs(contact.slip[-1]).max(initial=0.0))
        cells = [escape(printable(name)), *map(str, counts[:3]), *(f"{value:.4g}" for value in largest)]
        lines.append("".join(f"<td>{cell}</td>" for cell in cells))
    return "<table>" + "".join(f"<tr>{line}</tr>" for line in lines) + "</table>"
