"""The file of a sweep's table, where the disk does not take what is written."""

from __future__ import annotations

import errno
import os
from pathlib import Path
from typing import Any

import pytest

from pbem.errors import ResultFileError, StorageError
from pbem.sweeps.table import Row, TableFile


def refuse(number: int) -> Any:
    def fail(*_: object, **__: object) -> None:
        raise OSError(number, os.strerror(number))

    return fail


@pytest.mark.parametrize(("where", "name", "number"), [
    (os, "fsync", errno.ENOSPC), (Path, "replace", errno.EACCES),
])  # fmt: skip
def test_a_table_that_cannot_be_sorted_stays_as_it_is_with_its_lock(
    where: Any, name: str, number: int, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    path = tmp_path / "table.csv"
    table = TableFile(path, ["a"], ["force"], "mark", force=False)
    for cell in ("2", "1"):
        table.add(Row((cell,), (0.5,), "finished", 3, 0.1))
    written = path.read_bytes()
    with monkeypatch.context() as broken:
        broken.setattr(where, name, refuse(number))
        with pytest.raises(StorageError, match="cannot be sorted"):
            table.sort([("1",), ("2",)])
    assert path.read_bytes() == written and [each.name for each in tmp_path.iterdir()] == ["table.csv"]
    with pytest.raises(ResultFileError, match="is being written by another sweep"):
        TableFile(path, ["a"], ["force"], "mark", force=False)
    table.sort([("1",), ("2",)])
    assert [line[0] for line in path.read_text().splitlines()] == ["a", "1", "2"]
    with pytest.raises(ResultFileError, match="is being written by another sweep"):
        TableFile(path, ["a"], ["force"], "mark", force=False)
    table.close()
    TableFile(path, ["a"], ["force"], "mark", force=False).close()
