"""Files without checksums are tried before they are read: HDF5 may crash on damaged ones, or not come to an end.

Files lose their checksums when a program other than this one changes them. Such a file is read as a whole in a process
of its own first, with a limit of time. As a program: `python -m pbem.results.trial FILE.h5`.
"""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np

from pbem.results.tail import DamageError, check_pages

# Seconds that it takes to read a file: at least, and per byte.
PATIENCE, PER_BYTE = 60.0, 1e-7
# A launcher's own: the process is none of its ranks, and must not take part in MPI.
OF_LAUNCHERS = ("OMPI_", "PMIX_", "PMI_", "PRTE_", "MPI_", "SLURM_", "H5PY_")

_tried: set[tuple[int, int, int, int]] = set()


def check_contents(path: Path) -> None:
    """Raise DamageError for a file that is not as it was written; one without checksums is tried."""
    disk = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        checked = check_pages(disk) is not None
    finally:
        os.close(disk)
    if not checked:
        try_reading(path)


def try_reading(path: Path) -> None:
    """Raise DamageError for a file that HDF5 crashes on, or does not come to the end of.

    What it merely refuses is left for it to say. A file is tried once, as long as it is not changed.
    """
    state = path.stat()
    key = (state.st_dev, state.st_ino, state.st_size, state.st_mtime_ns)
    if key in _tried or not sys.executable:
        return
    patience = PATIENCE + PER_BYTE * state.st_size
    own = {name: value for name, value in os.environ.items() if not name.startswith(OF_LAUNCHERS)}
    try:
        # The path as it is seen from here; what the process says is of no interest, only how it ends.
        done = subprocess.run([sys.executable, "-m", "pbem.results.trial", str(path.absolute())], env=own,
                              stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                              timeout=patience, check=False)
    except subprocess.TimeoutExpired as error:
        raise DamageError(errno.EIO, "is damaged: HDF5 does not come to an end of it") from error
    except OSError:  # no process can be started here
        return
    if done.returncode < 0:
        raise DamageError(errno.EIO, f"is damaged: HDF5 ends by signal {-done.returncode} on it")
    _tried.add(key)


def read_everything(path: str) -> None:
    """Every attribute and dataset of a file. Raises what h5py raises where it is damaged."""

    def visit(_: str, item: h5py.HLObject) -> None:
        for name in item.attrs:
            item.attrs[name]
        if isinstance(item, h5py.Dataset) and item.shape:
            for start in range(0, item.shape[0], rows := max(1, 2**20 // max(1, int(np.prod(item.shape[1:]))))):
                item[start : start + rows]

    with h5py.File(path, "r", locking=False) as file:
        visit("", file)
        file.visititems(visit)


if __name__ == "__main__":
    read_everything(sys.argv[1])
