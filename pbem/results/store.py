"""The result file of a run, which only that run writes: made at once with its header, or opened to go on."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import h5py

from pbem.errors import ResultFileError
from pbem.heap import heap
from pbem.results.free_lists import empty_free_lists
from pbem.results.growing import GrowingRows
from pbem.results.journal import JournaledFile, lock
from pbem.results.opening import open_unlocked
from pbem.results.trial import try_reading

# The 1.8 format stores long lists of names. Only views need more; a file that is all of the 1.10 format could not be
# opened after its run was killed.
VERSIONS = ("v108", "v110")
# Bytes of objects' headers that HDF5 keeps in memory, where each takes some twenty times as much: of a file with
# thousands of datasets its own choice (2 MB) takes 70 MB.
CACHED = 1 << 18
TAKEN = "is being written by another run; wait for its end, or name another output file"


class Store:
    """An open result file. file: the h5py file; its changes are on the disk after `commit`, all of them or none.

    rows: adds entries to what grows with the steps.
    """

    def __init__(self, path: Path, fill: Callable[[h5py.File], None] | None = None) -> None:
        """Open an existing file; an empty one with what `fill` writes, which then is on the disk.

        Raises ResultFileError if another run has it, or it cannot be read or written; OSError if there is no room.
        """
        self.path = path
        try:
            self._journal = JournaledFile(path, waits=fill is None)
        except BlockingIOError as error:
            raise ResultFileError(str(path), TAKEN) from error
        except OSError as error:
            raise ResultFileError(str(path), f"cannot be used ({error.strerror or error})") from error
        try:
            if fill is not None:
                with h5py.File(self._journal, "w", libver=VERSIONS) as file:
                    _limit_cache(file)
                    fill(file)
                self._journal.commit()
                self._journal.waits = True
            elif not self._journal.checked:
                try_reading(path)
            self._reopen()
            empty_free_lists()
            heap.give_back()
        except BaseException:
            self._journal.close()
            raise

    def _reopen(self) -> None:
        # What HDF5 itself refuses ends badly in h5py when the file is not a path: it is tried as one before.
        open_unlocked(self.path).close()
        self.file = h5py.File(self._journal, "r+", libver=VERSIONS)
        _limit_cache(self.file)
        self.rows = GrowingRows(self.file)

    @property
    def dirty(self) -> bool:
        """Whether something was written that is not on the disk."""
        self.file.flush()
        return self._journal.dirty

    def commit(self) -> None:
        """Bring what was written to the disk. Raises OSError if there is no room; the file is then as before."""
        self.file.flush()
        self._journal.commit()

    def roll_back(self) -> None:
        """Forget what was written since the last commit."""
        with suppress(Exception):
            self.file.close()
        self._journal.abandon()
        self._reopen()

    def close(self) -> None:
        """Commit and close the file."""
        try:
            self.file.close()
            self._journal.commit(last=True)
        finally:
            self._journal.close()

    def drop(self) -> None:
        """Close the file as it is on the disk."""
        with suppress(Exception):
            self.file.close()
        self._journal.close()

    @property
    def is_open(self) -> bool:
        """Whether it may be written."""
        return bool(self.file)


def _limit_cache(file: h5py.File) -> None:
    """Let HDF5 keep no more than CACHED bytes of headers, whatever it finds useful."""
    config = file.id.get_mdc_config()
    config.set_initial_size = True
    config.initial_size = config.min_size = config.max_size = CACHED
    file.id.set_mdc_config(config)


def create_store(target: Path, replace: bool, fill: Callable[[h5py.File], None]) -> Store:
    """A new result file with what `fill` writes, under its name only when that is complete.

    replace: whether it may take the place of a file that is there. Raises ResultFileError if not, or if another run is
    writing that; OSError if it cannot be written, and then nothing is left behind.
    """
    remove_stale_parts(target)
    part = name_part(target)
    os.close(os.open(part, os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o666))
    try:
        store = Store(part, fill)
        try:
            _move(part, target, replace)
        except BaseException:
            store.drop()
            raise
    except BaseException:
        part.unlink(missing_ok=True)
        raise
    store.path = target
    return store


def _move(part: Path, target: Path, replace: bool) -> None:
    if replace and target.exists():
        old = os.open(target, os.O_RDONLY | os.O_CLOEXEC)
        try:
            if not lock(old):
                raise ResultFileError(str(target), TAKEN)
            part.replace(target)
        finally:
            os.close(old)
        return
    try:
        os.link(part, target)
    except FileExistsError as error:
        raise ResultFileError(str(target), "has been made by another run in the meantime") from error
    except OSError:  # no links on this file system
        part.replace(target)
    else:
        part.unlink()


def name_part(target: Path, kind: str = "") -> Path:
    """The name of a part of this process beside a result file."""
    return target.with_name(f".{target.name}.{os.getpid()}{kind and '.' + kind}.part")


def remove_stale_parts(target: Path) -> None:
    """Remove what other runs onto this file have left behind that were killed."""
    for part in target.parent.glob(f".{_escape(target.name)}.*.part"):
        if part.name.startswith(f".{target.name}.{os.getpid()}."):
            continue
        with suppress(OSError):
            disk = os.open(part, os.O_RDWR | os.O_CLOEXEC)
            try:
                if lock(disk):
                    part.unlink()
            finally:
                os.close(disk)


def _escape(name: str) -> str:
    """The name as a pattern that matches nothing else."""
    return "".join(f"[{character}]" if character in "*?[" else character for character in name)
