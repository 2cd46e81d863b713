"""Results as tables: columns of equal length, for pandas and for CSV files."""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbem.errors import ResultFileError
from pbem.results.lazy import JoinedContact
from pbem.results.reader import Results
from pbem.results.rigid import COMPONENTS
from pbem.results.trace_names import find_names, is_piece
from pbem.wording import list_names, suggest

Table = dict[str, NDArray[Any]]
PREFIX = "contact."
FIXED = ("position", "normal", "arc_length")


def make_table(results: Results, what: str) -> Table:
    """The columns of a table: `steps`, `reactions`, `rigid`, `tips`, `interior`, or the contact of an interface.

    That is named as contact.NAME, or by NAME alone if it is none of the others; "contact" is all of them. NAME may be a
    trace, which stands for all its pieces, along which arc_length goes on, or a pattern: then a column tells the
    interface. One row for each stored step and pair, curve, tip or point. Raises ResultFileError for what the file does
    not hold, TypeError for no text.
    """
    if not isinstance(what, str):
        raise TypeError(f"what: found {what!r}; expected the name of a table: {list_names(list_tables(results))}")
    known = list_tables(results)
    if what in known and not what.startswith(PREFIX):
        return KINDS[what](results)
    name = what.removeprefix(PREFIX)
    if name in results.contact:
        return _tabulate_contact(results, name)
    try:
        names = find_names([name], list(results.contact), results.contact.traces)[name]
        if all(is_piece(each, name) for each in names):
            return _tabulate_trace(results, name)
        return _tabulate_pieces(results, names)
    except ValueError as error:
        hint = suggest(name, [*known, *results.contact, *results.contact.traces.values()]) or ";"
        raise ResultFileError(str(results.path), f"has no table '{what}'{hint} it has {list_names(known)}") from error


def choose_table(results: Results) -> str:
    """What is written where nothing was asked for: the contact of all interfaces. Raises ResultFileError without any.
    """
    if len(results.contact):
        return "contact"
    known = list_names(list_tables(results))
    raise ResultFileError(str(results.path), f"has no interfaces; --what chooses among {known}")


def list_tables(results: Results) -> list[str]:
    """The names of all tables that the file holds."""
    there = {"steps": True, "reactions": bool(results.reactions), "tips": bool(results.tips),
             "rigid": bool(results.rigid),
             "interior": results.interior is not None, "contact": bool(len(results.contact))}
    return [*(name for name in KINDS if there[name]), *(PREFIX + name for name in results.contact)]


def write_csv(table: Mapping[str, NDArray[Any]], path: Path) -> None:
    """Comma-separated, a line of titles first; numbers with all their digits, NaN as an empty field.

    Raises ResultFileError if the file cannot be written.
    """
    try:
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(table)
            writer.writerows(zip(*(_spell(column) for column in table.values()), strict=True))
    except OSError as error:
        raise ResultFileError(str(path), f"cannot be written ({error.strerror or error})") from error


def _spell(column: NDArray[Any]) -> list[str]:
    if column.dtype.kind == "f":
        return ["" if value != value else repr(value) for value in column.tolist()]
    return [str(int(value) if isinstance(value, bool) else value) for value in column.tolist()]


def _tabulate_steps(results: Results) -> Table:
    steps = results.steps
    energy = {f"energy_{name}": values for name, values in vars(results.energy).items()}
    return {**_name_steps(results, 1), "iterations": steps.iterations, "residual": steps.residual, **energy}


def _name_steps(results: Results, rows: int) -> Table:
    """Number, stage and factor of the step of every row; rows of each step."""
    steps = results.steps
    stages = np.array(steps.stage_names, dtype=object)[steps.stage] if len(steps) else np.zeros(0, dtype=object)
    columns: Table = {"step": steps.number, "stage": stages, "factor": steps.factor}
    return {name: np.repeat(values, rows) for name, values in columns.items()}


def _repeat(results: Results, values: Any) -> NDArray[Any]:
    """The same at every step."""
    return np.tile(np.asarray(values), len(results.steps))


def _tabulate_reactions(results: Results) -> Table:
    names = np.array(list(results.reactions), dtype=object)
    forces = np.stack(list(results.reactions.values()), axis=1).reshape(-1, 2) if len(names) else np.zeros((0, 2))
    return {**_name_steps(results, len(names)), "curve": _repeat(results, names), "x": forces[:, 0], "y": forces[:, 1]}


def _tabulate_rigid(results: Results) -> Table:
    bodies = list(results.rigid.values())
    values = np.stack([np.concatenate([each.force, each.motion], axis=1) for each in bodies], axis=1).reshape(-1, 6)
    names = np.array([each.name for each in bodies], dtype=object)
    return {**_name_steps(results, len(bodies)), "body": _repeat(results, names),
            **{name: values[:, k] for k, name in enumerate(COMPONENTS)}}


def _tabulate_tips(results: Results) -> Table:
    """Ends of cracks that are tips at any step."""
    names = list(results.tips)
    kinds = ("KI", "KII", "J", "T")
    values = {kind: np.concatenate([getattr(tips, kind) for tips in results.tips.values()], axis=1) for kind in kinds}
    there = ~np.all([np.isnan(each).all(axis=0) for each in (values["KI"], values["J"])], axis=0)
    places = np.array([results.find_curve_ends(name) for name in names]).reshape(-1, 2)[there]
    crack = np.repeat(np.array(names, dtype=object), 2)[there]
    end = np.tile(np.array(["start", "end"], dtype=object), len(names))[there]
    return {
        **_name_steps(results, int(there.sum())), "crack": _repeat(results, crack), "end": _repeat(results, end),
        "x": _repeat(results, places[:, 0]), "y": _repeat(results, places[:, 1]),
        **{kind: each[:, there].ravel() for kind, each in values.items()},
    }


def _tabulate_interior(results: Results) -> Table:
    interior = results.interior
    assert interior is not None
    names = np.array([*results.nodes.region_names, ""], dtype=object)
    moved, stress = interior.displacement.reshape(-1, 2), interior.stress.reshape(-1, 3)
    return {
        **_name_steps(results, len(interior.position)), "x": _repeat(results, interior.position[:, 0]),
        "y": _repeat(results, interior.position[:, 1]), "region": _repeat(results, names[interior.region]),
        "ux": moved[:, 0], "uy": moved[:, 1], **{name: stress[:, i] for i, name in enumerate(("sxx", "syy", "sxy"))},
    }


def _tabulate_contact(results: Results, name: str) -> Table:
    contact = results.contact[name]
    fixed: Table = {
        "pair": np.arange(contact.pairs), "x": contact.position[:, 0], "y": contact.position[:, 1],
        "arc_length": contact.arc_length, "normal_x": contact.normal[:, 0], "normal_y": contact.normal[:, 1],
    }
    shown = ("mode", "opening", "slip", "traction_n", "traction_s")
    growing = {each: getattr(contact, each) for each in shown} | dict(contact.internal)
    return {
        **_name_steps(results, contact.pairs), **{each: _repeat(results, values) for each, values in fixed.items()},
        **{each: values.ravel() for each, values in growing.items()},
    }


def _tabulate_trace(results: Results, trace: str) -> Table:
    """The pieces of a trace together, step by step, in their order along it."""
    joined = results.contact[trace]
    assert isinstance(joined, JoinedContact)
    table = _tabulate_pieces(results, [piece.name for piece in joined.pieces])
    return {**table, "arc_length": _repeat(results, joined.arc_length)}


def _tabulate_pieces(results: Results, names: Sequence[str]) -> Table:
    """Some interfaces together, step by step, with the internal variables that all of them have."""
    tables = [_tabulate_contact(results, name) for name in names]
    places = [np.repeat(np.arange(len(results.steps)), results.contact[name].pairs) for name in names]
    owner = np.repeat(np.array(names, dtype=object), [len(each) for each in places])
    order = np.argsort(np.concatenate(places), kind="stable")
    shared = [title for title in tables[0] if all(title in table for table in tables)]
    columns = {title: np.concatenate([table[title] for table in tables])[order] for title in shared}
    first = list(_name_steps(results, 1))
    return {**{title: columns[title] for title in first}, "interface": owner[order], **columns}


def _tabulate_contacts(results: Results) -> Table:
    """All interfaces together, with what they have in common."""
    pairs = results.pairs
    names = np.array(pairs.names, dtype=object)[pairs.interface]
    fixed: Table = {
        "interface": names, "x": pairs.position[:, 0], "y": pairs.position[:, 1], "arc_length": pairs.arc_length,
        "normal_x": pairs.normal[:, 0], "normal_y": pairs.normal[:, 1],
    }
    shown = ("mode", "opening", "slip", "traction_n", "traction_s")
    growing = {
        each: np.concatenate([np.zeros(0), *(pairs.at(each, at) for at in range(len(results.steps)))]) for each in shown
    }
    growing["mode"] = growing["mode"].astype(np.int8)
    return {**_name_steps(results, pairs.count), **{each: _repeat(results, v) for each, v in fixed.items()}, **growing}


KINDS: Mapping[str, Callable[[Results], Table]] = {
    "steps": _tabulate_steps, "reactions": _tabulate_reactions, "tips": _tabulate_tips, "interior": _tabulate_interior,
    "contact": _tabulate_contacts, "rigid": _tabulate_rigid,
}


def make_dataframe(results: Results, what: str) -> Any:
    """The table as a pandas.DataFrame. Raises ImportError, which names the package, if pandas is not installed."""
    return frame_columns(lambda: make_table(results, what))


def frame_columns(find: Callable[[], Mapping[str, Any]]) -> Any:
    """A pandas.DataFrame of columns, found once it is there. Raises ImportError as `make_dataframe`."""
    try:
        import pandas
    except ImportError as error:
        raise ImportError(
            "to_dataframe needs the package pandas, which is not installed: pip install pandas, or on Debian and "
            "Ubuntu apt-get install python3-pandas"
        ) from error
    return pandas.DataFrame(find())
