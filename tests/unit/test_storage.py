"""A step that the disk has no room for is refused before the file is touched."""

from __future__ import annotations

import os
from pathlib import Path
from types import SimpleNamespace

import pytest

from pbem.errors import ResultFileError, StorageError
from pbem.results.output import check_output_path
from pbem.results.reader import open_results
from pbem.results.writer import ResultWriter
from tests.unit.results_sample import make_mesh, make_model, make_steps


def test_a_full_disk_leaves_the_steps_before_readable(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    model = make_model()
    mesh = make_mesh(model)
    first, second, *_ = make_steps(model, mesh)
    path = tmp_path / "a.h5"
    with pytest.raises(StorageError, match="no room for step 2"):  # noqa: SIM117
        with ResultWriter(path, model, mesh, 1, "3.18.5") as writer:
            writer.append(first)
            monkeypatch.setattr(os, "statvfs", lambda _: SimpleNamespace(f_bavail=10, f_frsize=4096))
            writer.append(second)
    results = open_results(path)
    assert results.status == "failed"
    assert len(results.steps) == 1


def test_only_regular_files_are_written() -> None:
    with pytest.raises(ResultFileError, match="not a regular file"):
        check_output_path("/dev/null")
