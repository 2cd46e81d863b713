"""The table of a sweep, one row per case: in memory, and as a file that grows row by row and can be continued."""

from __future__ import annotations

import contextlib
import csv
import html
import io
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbem.errors import ResultFileError, StorageError, printable
from pbem.results.journal import lock
from pbem.results.tables import frame_columns
from pbem.sweeps.values import write_cell

# After the values that were set and the quantities. case: a mark of the case and its settings, by which a table that
# belongs to another one is known.
LAST_COLUMNS = ("status", "iterations", "seconds", "reason", "case")
MOST_SHOWN = 12


@dataclass(frozen=True)
class Row:
    """A case that was computed. cells: its values as they are written; quantities: NaN where there is none."""

    cells: tuple[str, ...]
    quantities: tuple[float, ...]
    status: str
    iterations: int
    seconds: float
    reason: str = ""

    def write(self, mark: str) -> list[str]:
        """The cells of a line of the file."""
        numbers = ["" if np.isnan(each) else repr(float(each)) for each in self.quantities]
        return [*self.cells, *numbers, self.status, str(self.iterations), f"{self.seconds:.3f}",
                " ".join(printable(self.reason).split()), mark]


class SweepTable:
    """One row per case: the values that were set, the quantities, status, iterations, seconds, reason.

        table["reactions.top.x"]     # a column: an array, NaN where a case did not converge
        for row in table: ...        # rows as dictionaries
        table.to_dataframe()         # of pandas

    columns: their names; values: those of the columns that were set.
    """

    def __init__(
        self, values: Mapping[str, Sequence[Any]], quantities: Sequence[str], rows: Sequence[Mapping[str, Any]]
    ) -> None:
        self.columns = (*values, *quantities, *LAST_COLUMNS[:-1])
        self.values = {key: tuple(each) for key, each in values.items()}
        self._rows = tuple(dict(row) for row in rows)

    def __len__(self) -> int:
        return len(self._rows)

    def __iter__(self) -> Iterator[dict[str, Any]]:
        return (dict(row) for row in self._rows)

    def __getitem__(self, column: str) -> NDArray[Any]:
        """A column (rows,), numeric if all entries are numbers. Raises KeyError with the names of all columns."""
        if column not in self.columns:
            raise KeyError(f"no column {column!r}; there are {', '.join(self.columns)}")
        values = [row[column] for row in self._rows]
        if all(isinstance(value, int | float) and not isinstance(value, bool) for value in values):
            return np.array(values)
        array = np.empty(len(values), dtype=object)
        array[:] = values
        return array

    def to_dataframe(self) -> Any:
        """The table as a pandas.DataFrame. Raises ImportError if pandas is not installed."""
        return frame_columns(lambda: {column: list(self[column]) for column in self.columns})

    def __repr__(self) -> str:
        shown = [list(self.columns), *([_show(row[each]) for each in self.columns] for row in self._rows[:MOST_SHOWN])]
        widths = [max(len(row[k]) for row in shown) for k in range(len(self.columns))]
        lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
                 for row in shown]
        more = len(self) - MOST_SHOWN
        failed = sum(row["status"] != "finished" for row in self._rows)
        lines += [f"... and {more} more rows"] if more > 0 else []
        return "\n".join([*lines, f"[{len(self)} cases, {failed} not finished]"])

    def _repr_html_(self) -> str:
        """For notebooks."""
        def line(cells: Sequence[str], tag: str) -> str:
            return "<tr>" + "".join(f"<{tag}>{html.escape(cell)}</{tag}>" for cell in cells) + "</tr>"

        rows = [line([_show(row[each]) for each in self.columns], "td") for row in self._rows[:MOST_SHOWN]]
        more = f"<p>{len(self)} rows</p>" if len(self) > MOST_SHOWN else ""
        return f"<table>{line(self.columns, 'th')}{''.join(rows)}</table>{more}"


def _show(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else printable(write_cell(value))


class TableFile:
    """A table of comma-separated values to which rows are added one by one; for one rank of one sweep only, which has
    the lock of the file until `close`: what another sweep adds meanwhile would be lost when the rows are sorted.

    header: names of its columns. done: the rows that it has, by the cells of their values.
    """

    def __init__(self, path: str | os.PathLike[str], values: Sequence[str], quantities: Sequence[str], mark: str,
                 force: bool) -> None:
        """Raises ResultFileError if the file cannot be written, is no table of a sweep, or is that of another one, or
        if another sweep is writing it."""
        self._lock = -1
        self.path, self._values, self._quantities, self._mark = Path(path), len(values), len(quantities), mark
        self.header = [*values, *quantities, *LAST_COLUMNS]
        self.done: dict[tuple[str, ...], Row] = {}
        self._repeated = False  # rows that were computed again follow those they replace until the rows are sorted
        try:
            if self.path.is_dir():
                raise ResultFileError(str(path), "is a folder; name a file in it")
            if self.path.exists() and not self.path.is_file():
                raise ResultFileError(str(path), "is not a regular file")
            self._take_lock()
            there = self.path.stat().st_size > 0
            if there:
                self._take(self.path.read_bytes(), force)
            if not there or force:
                self._replace([])
        except OSError as error:
            self.close()
            raise ResultFileError(str(path), f"cannot be written ({error.strerror or error})") from error
        except BaseException:
            self.close()
            raise

    def _take_lock(self) -> None:
        """Make the file if there is none, and lock it; once more if another sweep has replaced it meanwhile."""
        while True:
            self._lock = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
            if not lock(self._lock):
                raise ResultFileError(
                    str(self.path), "is being written by another sweep; wait for its end, or name another file")
            if self.path.exists() and os.path.samestat(os.fstat(self._lock), self.path.stat()):
                return
            self.close()

    def close(self) -> None:
        """Give the lock back."""
        if self._lock >= 0:
            os.close(self._lock)
            self._lock = -1

    def _take(self, data: bytes, force: bool) -> None:
        try:
            lines = list(csv.reader(io.StringIO(data.decode("utf-8"), newline="")))
        except (UnicodeDecodeError, csv.Error):
            lines = []
        if not lines or tuple(lines[0][-len(LAST_COLUMNS):]) != LAST_COLUMNS:
            raise ResultFileError(str(self.path), "exists already and is not a table of a sweep; name another file")
        if force:
            return
        if lines[0] != self.header:
            raise ResultFileError(str(self.path), f"is the table of another sweep: {_compare(lines[0], self.header)}; "
                                  "--force replaces it, -o names another file")
        whole = data.endswith(b"\n")
        rows = lines[1:] if whole else lines[1:-1]  # cut off in the middle of a line
        for number, cells in enumerate(rows, start=2):
            row = self._read(cells)
            if row is None:
                raise ResultFileError(str(self.path), f"line {number} is no row of such a table; correct or delete it")
            if cells[-1] != self._mark:
                raise ResultFileError(
                    str(self.path), "holds rows of another case, of this case before it was changed, or of other "
                    "settings; --force replaces it, -o names another file")
            self._repeated |= row.cells in self.done
            self.done[row.cells] = row
        if not whole:
            self._replace(list(self.done.values()))

    def _read(self, cells: list[str]) -> Row | None:
        if len(cells) != len(self.header):
            return None
        first, last = self._values, self._values + self._quantities
        status, iterations, seconds, reason, _ = cells[last:]
        try:
            numbers = tuple(float(each) if each else float("nan") for each in cells[first:last])
            return Row(tuple(cells[:first]), numbers, status, int(iterations), float(seconds), reason)
        except ValueError:
            return None

    def add(self, row: Row) -> None:
        """Write one row; it is on the disk when this returns. Raises StorageError if there is no room."""
        self._repeated |= row.cells in self.done
        self.done[row.cells] = row
        try:
            with self.path.open("a", encoding="utf-8", newline="") as file:
                file.write(_write_lines([row.write(self._mark)]))
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            raise StorageError(str(self.path), f"no room for a row ({error.strerror or error})") from error

    def sort(self, order: Sequence[tuple[str, ...]]) -> None:
        """Bring the rows into an order, those that are not in it after them. Raises StorageError."""
        places = {cells: number for number, cells in enumerate(order)}
        rows = sorted(self.done.values(), key=lambda row: places.get(row.cells, len(places)))
        if rows == list(self.done.values()) and not self._repeated:
            return
        try:
            self._replace(rows)
            self._repeated = False
        except OSError as error:
            raise StorageError(str(self.path), f"cannot be sorted ({error.strerror or error})") from error

    def _replace(self, rows: Sequence[Row]) -> None:
        """Another file in its place, at once; if that fails, the file stays as it is, with its lock."""
        target = Path(os.path.realpath(self.path))
        part = target.with_name(f".{target.name}.part")
        with contextlib.ExitStack() as undo:
            undo.callback(part.unlink, missing_ok=True)
            with part.open("w", encoding="utf-8", newline="") as file:
                file.write(_write_lines([self.header, *(row.write(self._mark) for row in rows)]))
                file.flush()
                os.fsync(file.fileno())
                own = os.dup(file.fileno())
            undo.callback(os.close, own)
            lock(own)
            part.replace(target)
            undo.pop_all()
        former, self._lock = self._lock, own
        os.close(former)


def _write_lines(lines: Sequence[Sequence[str]]) -> str:
    buffer = io.StringIO(newline="")
    csv.writer(buffer, lineterminator="\n").writerows(lines)
    return buffer.getvalue()


def _compare(there: Sequence[str], wanted: Sequence[str]) -> str:
    """In which columns two tables differ."""
    more = [each for each in there if each not in wanted]
    less = [each for each in wanted if each not in there]
    parts = [f"it has {', '.join(more)}"] if more else []
    parts += [f"it lacks {', '.join(less)}"] if less else []
    return " and ".join(parts) or "its columns are in another order"
