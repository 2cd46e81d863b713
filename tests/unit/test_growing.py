"""Entries that are added to datasets are those that h5py itself writes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from pbem.results.growing import GrowingRows

COLUMNS = np.dtype([("number", "i4"), ("residual", "f8")])


@pytest.mark.parametrize(("shape", "kind", "rows"), [
    ((), "f8", [1.5, np.nan, 3]),
    ((), "i1", [np.int64(-2), 100]),
    ((), "i8", [7, np.int32(8)]),
    ((3,), "f8", [np.arange(3.0), np.nan, np.arange(3)]),
    ((2, 3), "f4", [np.arange(6.0).reshape(3, 2).T, np.ones((2, 3))]),
    ((0,), "f8", [np.zeros(0), np.zeros(0)]),
    ((), COLUMNS, [np.array((1, 0.5), COLUMNS), np.array((2, 0.25), COLUMNS)]),
])
def test_entries_are_those_of_h5py(tmp_path: Path, shape: tuple[int, ...], kind: Any, rows: list[Any]) -> None:
    with h5py.File(tmp_path / "grown.h5", "w") as file:
        mine, other = (file.create_dataset(name, (0, *shape), kind, maxshape=(None,) * (1 + len(shape)), chunks=(4, *(
            max(1, each) for each in shape))) for name in ("mine", "other"))
        growing = GrowingRows(file)
        for row in rows:
            growing.append("mine", row)
            other.resize(len(other) + 1, axis=0)
            other[-1] = row
        assert mine.shape == (len(rows), *shape) and mine[()].tobytes() == other[()].tobytes()


def test_entries_are_added_by_the_names_of_their_columns(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "grown.h5", "w") as file:
        table = file.create_dataset("table", (0,), COLUMNS, maxshape=(None,), chunks=(2,))
        growing = GrowingRows(file)
        entries = np.array([(0.5, 7, 1), (0.25, 8, 2), (0.125, 9, 3)], [("residual", "f4"), ("more", "i8"),
                                                                      ("number", "i8")])
        for begin, end in ((0, 1), (1, 1), (1, 3)):
            growing.extend("table", entries[begin:end])
        assert table[...].tolist() == [(1, 0.5), (2, 0.25), (3, 0.125)]


def test_entries_of_another_shape_are_refused_and_leave_the_dataset_alone(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "grown.h5", "w") as file:
        dataset = file.create_dataset("mine", (0, 3), "f8", maxshape=(None, 3))
        with pytest.raises(ValueError, match="broadcast"):
            GrowingRows(file).append("mine", np.zeros(4))
        assert dataset.shape == (0, 3)


def test_entries_reach_the_file_though_its_datasets_stay_open(tmp_path: Path) -> None:
    """After a flush whoever opens it finds them; a file that is opened once more has rows of its own."""
    path = tmp_path / "grown.h5"
    with h5py.File(path, "w") as file:
        group = file.create_group("fields")
        group.create_dataset("many", (0, 5000), "f8", maxshape=(None, 5000), chunks=(2, 5000))
        group.create_dataset("few", (0,), "i4", maxshape=(None,), chunks=(64,))
    for begin in (0, 70):
        with h5py.File(path, "r+") as file:
            rows = GrowingRows(file)
            assert rows.list_names("fields") == ("few", "many") and rows.list_names("others") == ()
            for number in range(begin, begin + 70):
                rows.append("fields/few", number)
                rows.append("fields/many", np.full(5000, float(number)))
            file.flush()
            assert file["fields/few"][-1] == begin + 69
            with pytest.raises(KeyError):
                rows.append("fields/none", 1.0)
    with h5py.File(path) as file:
        assert (file["fields/few"][...] == np.arange(140)).all()
        assert (file["fields/many"][...] == np.arange(140)[:, None]).all()
