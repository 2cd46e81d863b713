"""What was done to the traces, in lines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pbem.case.writer import write_tables
from pbem.errors import printable
from pbem.geometry.network import Change
from pbem.geometry.network.parts import Kind
from pbem.importing.options import Imported

# In this order, each with its title for one and for several, and the words of a line.
TITLES: Mapping[Kind, tuple[str, str, str]] = {
    "dropped": ("trace dropped, of which the snap distance leaves nothing",
                "traces dropped, of which the snap distance leaves nothing", "{trace} at {place}: {distance} long"),
    "thinned": ("vertex left out, no further than the snap distance from another one of its trace",
                "vertices left out, no further than the snap distance from another one of their trace",
                "{trace} at {place}: {distance} from the next"),
    "joined": ("end or vertex joined to what it all but reaches", "ends and vertices joined to what they all but reach",
               "{trace} at {place}: moved by {distance} to {other}"),
    "cut off": ("end cut off that pokes through another trace", "ends cut off that poke through another trace",
                "{trace} at {place}: {distance} beyond {other}"),
    "bent": ("trace moved sideways to pass through a point of another one",
             "traces moved sideways to pass through a point of another one",
             "{trace} at {place}: by {distance}, to {other}"),
    "merged": ("stretch that lies on another trace, which keeps it",
               "stretches that lie on another trace, which keeps them",
               "{trace} from {place} on: {distance} long, on {other}"),
    "cut": ("cut, where traces cross or meet", "cuts, where traces cross or meet", "{trace} at {place}, by {other}"),
}
# Lines of each kind that the terminal shows; of cuts, which change no shape, the number will do.
MOST_SHOWN = 5
CUTS = TITLES["cut"][:2]


def format_place(point: complex) -> str:
    """A point of a map, whose coordinates may have many digits in front of those that matter."""
    return f"({point.real:.10g}, {point.imag:.10g})"


def list_changes(changes: Sequence[Change]) -> tuple[tuple[str, tuple[str, ...]], ...]:
    """Titles, with counts, and lines."""
    groups = []
    for kind, (single, several, form) in TITLES.items():
        lines = tuple(
            form.format(trace=each.trace, place=format_place(each.place), distance=f"{each.distance:.3g}",
                        other="itself" if each.other == each.trace else each.other)
            for each in changes if each.kind == kind
        )
        if lines:
            most = max(each.distance for each in changes if each.kind == kind)
            largest = f", by {most:.3g} at most" if kind in ("joined", "cut off", "bent") else ""
            groups.append((f"{len(lines)} {single if len(lines) == 1 else several}{largest}", lines))
    return tuple(groups)


def write_case(
    name: str, tables: Mapping[str, Any], summary: Sequence[str], notes: Sequence[str],
    changes: Sequence[tuple[str, Sequence[str]]], command: str,
) -> str:
    """The text of a case file; its first comment says what it was made of, and all that was changed."""
    lines = [f"Made from {name} by:", f"  {command}", *summary, *notes]
    for title, entries in changes:
        lines += ["", f"{title}:", *(f"  {entry}" for entry in entries)]
    comment = "\n".join(f"# {printable(line)}".rstrip() for line in lines)
    return f"{comment}\n\n{write_tables(tables)}"


def describe(imported: Imported, target: str) -> str:
    """What the terminal shows: of long lists the first lines."""
    lines = [f"case file: {target}", *imported.summary, *imported.notes]
    for title, entries in imported.changes:
        if title.endswith(CUTS):
            lines.append(f"{title}: listed in the comment of the case file")
            continue
        lines.append(f"{title}:")
        lines += [f"  {entry}" for entry in entries[:MOST_SHOWN]]
        if len(entries) > MOST_SHOWN:
            lines.append(f"  and {len(entries) - MOST_SHOWN} more, in the comment of the case file")
    return "\n".join(lines)
