"""What a run has told its user of the model and of the results, as the result file keeps it."""

from __future__ import annotations

from collections.abc import Iterable

import h5py

NOTES = "notes"


def read_notes(file: h5py.File) -> tuple[str, ...]:
    """The notes in the order in which they were told; none in files of earlier versions."""
    return tuple(file[NOTES].asstr()[...].tolist()) if NOTES in file else ()


def append_notes(file: h5py.File, notes: Iterable[str]) -> bool:
    """Keep these notes in addition to those that the file has, each of them once; whether there were any.

    They are rows of a dataset: an attribute would be written whole for each new one, and take the room of all before.
    """
    kept = dict.fromkeys(read_notes(file))
    new = [each for each in dict.fromkeys(notes) if each not in kept]
    if not new:
        return False
    if NOTES not in file:
        file.create_dataset(NOTES, shape=(0,), maxshape=(None,), dtype=h5py.string_dtype(), chunks=(64,))
    file[NOTES].resize(len(kept) + len(new), axis=0)
    file[NOTES][len(kept):] = new
    return True
