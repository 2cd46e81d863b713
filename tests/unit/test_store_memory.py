"""What the only writer of a file holds in memory: no more of the file than a few pages, and nothing for HDF5's sake."""

from __future__ import annotations

import ctypes
import errno
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest

from pbem.results import free_lists, journal
from pbem.results.store import Store, create_store
from pbem.results.tail import PAGE
from pbem.results.views import create_array, create_group

GROUPS = 600


def fill_groups(file: h5py.Group) -> None:
    """Many small groups, as of a field of cracks."""
    for number in range(GROUPS):
        group = create_group(file.id, f"g{number}")
        for name in ("a", "b", "c"):
            create_array(group, name, np.arange(60.0) + number)
        file[f"g{number}"].attrs["law"] = "coulomb"


def count_kept() -> int:
    """Bytes that HDF5 keeps in its lists of freed objects."""
    sizes = (ctypes.c_size_t * 4)()
    step = ctypes.sizeof(ctypes.c_size_t)
    ask = ctypes.PyDLL(h5py.h5f.__file__).H5get_free_list_sizes
    assert ask(*(ctypes.byref(sizes, k * step) for k in range(4))) >= 0
    return sum(sizes)


def expect_groups(path: Path) -> None:
    """All that was written is there."""
    with h5py.File(path) as file:
        assert len(file) == GROUPS
        for number in (0, 1, GROUPS // 2, GROUPS - 1):
            assert np.array_equal(file[f"g{number}/c"][...], np.arange(60.0) + number)


def write_plainly(path: Path) -> int:
    """The same by HDF5 alone; what it keeps afterwards."""
    with h5py.File(path, "w", libver=("v108", "v110")) as file:
        fill_groups(file)
    return count_kept()


def test_hdf5_keeps_nothing_for_objects_to_come(tmp_path: Path) -> None:
    plain = write_plainly(tmp_path / "plain.h5")
    store = create_store(tmp_path / "a.h5", False, fill_groups)
    assert count_kept() < 0.5 * plain  # some belongs to the file that is open
    store.close()
    expect_groups(tmp_path / "a.h5")


def test_few_headers_stay_in_memory(tmp_path: Path) -> None:
    """HDF5 keeps headers of a file's objects, in far more room than they take there."""
    kept: list[int] = []

    def fill(file: h5py.File) -> None:
        for number in range(4):
            fill_groups(file.create_group(f"part{number}"))
        kept.append(file.id.get_mdc_size()[0])

    with h5py.File(tmp_path / "plain.h5", "w", libver=("v108", "v110")) as file:
        fill(file)
    store = create_store(tmp_path / "a.h5", False, fill)
    for number in range(GROUPS):
        store.file[f"part0/g{number}"].create_dataset("d", data=np.arange(6.0))
    kept.append(store.file.id.get_mdc_size()[0])
    store.close()
    assert max(kept[1:]) < 0.3 * kept[0]


def test_nothing_is_left_to_free_after_a_commit(tmp_path: Path) -> None:
    """What HDF5 keeps then is of the open file, which is why the lists are emptied after the header alone."""
    store = create_store(tmp_path / "a.h5", False, fill_groups)
    for step in range(3):
        for number in range(0, GROUPS, 3):
            store.file[f"g{number}"].create_dataset(f"s{step}", data=np.arange(6.0))
        store.commit()
    before = count_kept()
    assert free_lists.empty_free_lists()
    assert count_kept() > 0.7 * before
    store.close()


@pytest.mark.parametrize("missing", ["_objects", "h5f"])
def test_files_are_written_without_h5pys_inner_names(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, missing: str
) -> None:
    own = SimpleNamespace(h5f=h5py.h5f, _objects=SimpleNamespace(phil=nullcontext()))
    delattr(own, missing)
    monkeypatch.setattr(free_lists, "h5py", own)
    free_lists._find_collector.cache_clear()
    try:
        assert not free_lists.empty_free_lists()
        store = create_store(tmp_path / "a.h5", False, fill_groups)
        store.commit()
        store.close()
    finally:
        free_lists._find_collector.cache_clear()
    expect_groups(tmp_path / "a.h5")


@pytest.fixture
def held(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Numbers of pages in memory whenever something was written, at most 60 of which may wait."""
    counts: list[int] = []
    monkeypatch.setattr(journal, "MOST_WAITING", 60)
    write: Callable[..., int] = journal.JournaledFile.write

    def count(self: journal.JournaledFile, data: memoryview) -> int:
        done = write(self, data)
        counts.append(len(self._pages))
        return done

    monkeypatch.setattr(journal.JournaledFile, "write", count)
    return counts


def test_a_new_file_does_not_wait_in_memory(held: list[int], tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    store = create_store(path, False, fill_groups)
    assert max(held) <= 60
    assert path.stat().st_size > 100 * PAGE
    held.clear()
    # From now on all writes wait for the next commit, as a kill must leave the former state.
    store.file["more"] = np.ones(100_000)
    store.file.flush()
    assert max(held) > 100
    store.drop()
    expect_groups(path)
    store = Store(path)
    assert "more" not in store.file
    store.file["more"] = np.ones(100_000)
    store.close()
    with h5py.File(path) as file:
        assert file["more"][-1] == 1.0


def test_where_the_disk_is_full_the_new_file_leaves_nothing(
    held: list[int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(journal, "write_fully", refuse)
    with pytest.raises(OSError, match="No space"):
        create_store(tmp_path / "a.h5", False, fill_groups)
    assert max(held) > 100  # they had to wait
    assert not list(tmp_path.iterdir())
