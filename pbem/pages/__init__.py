"""The pages of documentation that `pbem help TOPIC` prints: one file NAME.md in this folder for each topic.

They are plain Markdown in ASCII, to be read in a terminal and on a git host alike. The page of keys is made from the
schema of case files (pbem.pages.keys); the page of theory numbers the formulas that the code cites.
"""

from __future__ import annotations

import difflib
from itertools import groupby
from pathlib import Path

FOLDER = Path(__file__).resolve().parent

# In the order in which they are listed, with what they are about.
TOPICS = {
    "install": "how to install, on Debian, Ubuntu and elsewhere",
    "commands": "commands, options, exit codes and messages",
    "cases": "how a case file describes bodies, cracks, contacts and loads",
    "gallery": "cases with known answers to start from, by subject",
    "keys": "all keys of the case file, with types, ranges and defaults",
    "import": "cases from maps of traces and from meshes",
    "laws": "friction laws, and how to write one",
    "signs": "signs and directions",
    "results": "the result file, and how to read it in Python",
    "python": "cases, runs and overrides in Python",
    "sweeps": "parameter sweeps: one row of a table per combination of values",
    "pictures": "the pictures that `pbem plot` draws",
    "paraview": "results in ParaView and PyVista",
    "convergence": "how contact is solved, why a run stops, and what to do",
    "accuracy": "meshes, estimated errors, and measured accuracy",
    "large-models": "thousands of cracks or inclusions: methods, time and memory",
    "clusters": "job scripts, ranks, and errors at the start",
    "limits": "what the program cannot do",
    "theory": "every formula that the code uses, numbered, with sources",
    "code": "how the source code is organised, and where to change what",
}


def find_topic(words: str) -> str | None:
    """The topic of this name; spaces, underscores and capitals do not matter. None if there is none."""
    name = "-".join(words.lower().replace("_", " ").replace("-", " ").split())
    return name if name in TOPICS else None


def suggest_topic(words: str) -> str:
    """A topic with a similar name; empty if there is none."""
    name = "-".join(words.lower().split())
    near = difflib.get_close_matches(name, [*TOPICS, *(f"{topic}s" for topic in TOPICS)], n=1, cutoff=0.6)
    return "" if not near else near[0] if near[0] in TOPICS else near[0][:-1]


def read_page(topic: str) -> str:
    """The text of a page, as it is in its file."""
    return (FOLDER / f"{topic}.md").read_text(encoding="utf-8")


def list_topics() -> str:
    """All topics, a line each."""
    width = max(map(len, TOPICS))
    return "\n".join(f"  {topic:{width}}  {about}" for topic, about in TOPICS.items())


def lay_out(page: str) -> str:
    """The page as a terminal shows it best: columns of tables below each other."""
    lines: list[str] = []
    for is_table, group in groupby(page.splitlines(), lambda line: line.startswith("|")):
        rows = list(group)
        lines += _align_columns(rows) if is_table else rows
    return "\n".join(lines)


def _align_columns(rows: list[str]) -> list[str]:
    """The rows of a table with cells of equal width; the last column, of texts, is left as long as it is."""
    cells = [[cell.strip() for cell in row.strip().strip("|").split("|")] for row in rows]
    widths = [max(len(row[column]) for row in cells if not _is_rule(row)) for column in range(len(cells[0]))]
    return [
        "  ".join("-" * width for width in widths) if _is_rule(row)
        else "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in cells
    ]


def _is_rule(row: list[str]) -> bool:
    return all(set(cell) <= set("-:") and cell for cell in row)
