"""The file of a finished pass of `analysis.accuracy`: kept while a finer one is computed in its place."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import h5py

from pbem.errors import ResultFileError
from pbem.model.refinement import Fractions
from pbem.results.accuracy import Pass
from pbem.results.journal import lock
from pbem.results.layout import MAY_FOLLOW, count_steps, read_fractions
from pbem.results.notes import append_notes
from pbem.results.opening import open_quietly, refuse_damage
from pbem.results.store import Store, name_part
from pbem.results.trial import check_contents
from pbem.results.writer import ResultWriter


@dataclass(frozen=True)
class Refinement:
    """Where a result file that is to be gone on with stands: the element ends of its mesh, and its pass.

    finished: the number of its stages, if it holds all of their steps; 0 if it does not.
    """

    fractions: Fractions
    one: Pass
    finished: int = 0


def read_refinement(path: Path) -> Refinement | None:
    """What a file says of its refinement; None if it says nothing.

    Raises ResultFileError if it cannot be read.
    """
    try:
        with refuse_damage(path):
            check_contents(path)
        with open_quietly(path) as file:
            fractions = read_fractions(file)
            if fractions is None:
                return None
            attributes = file["mesh"].attrs  # files of earlier versions do not say
            one = Pass(int(attributes.get("pass", 1)), int(attributes.get("first_unknowns", 0)))
            whole, k = file.attrs.get("status") == "finished" and not file.attrs.get(MAY_FOLLOW), count_steps(file)
            return Refinement(fractions, one, int(file["steps/stage"][k - 1]) + 1 if whole and k else 0)
    except (OSError, KeyError, ValueError) as error:
        raise ResultFileError(str(path), f"is not a readable result file ({error})") from error


@dataclass(frozen=True)
class PassOutput:
    """The open result file, on the first rank; nothing on the others. former: the pass whose place it takes."""

    writer: ResultWriter | None = None
    former: KeptPass | None = None


def open_beside(target: Path, create: Callable[[], ResultWriter]) -> PassOutput:
    """A new file in the place of that of the former pass, which is kept beside it. Raises ResultFileError."""
    former = keep_pass(target)
    try:
        writer = create()
    except BaseException:
        former.drop()
        raise
    former.hold()
    return PassOutput(writer, former)


def keep_pass(target: Path) -> KeptPass:
    """The file of a pass that is finished, before another one takes its place. Raises ResultFileError."""
    try:
        return KeptPass(target)
    except OSError as error:
        raise ResultFileError(str(target), f"cannot be kept beside a finer pass ({error.strerror or error})") from error


def holds_steps(path: Path) -> bool:
    """Whether a step is stored in a result file. Raises ResultFileError if it cannot be read."""
    try:
        with open_quietly(path) as file:
            return count_steps(file) > 0
    except (OSError, KeyError, ValueError) as error:
        raise ResultFileError(str(path), f"is not a readable result file ({error})") from error


def expect_no_pass(path: Path, notes: Iterable[str] = ()) -> None:
    """Say in the file of a finished pass that no other one follows, with what was told of that. Raises ResultFileError.
    """
    try:
        with change_file(path) as file:
            file.attrs.pop(MAY_FOLLOW, None)
            append_notes(file, notes)
    except OSError as error:
        raise ResultFileError(str(path), f"cannot be written ({error.strerror or error})") from error


@contextmanager
def change_file(path: Path) -> Iterator[h5py.File]:
    """A closed file, as the block leaves it; as it was if it raises. Raises ResultFileError, OSError."""
    with refuse_damage(path):
        storage = Store(path)
    try:
        yield storage.file
        storage.close()
    except BaseException:
        storage.drop()
        raise


class KeptPass:
    """The file of the last pass under a second name, until the next pass is finished; for one rank only.

    A process that is killed before that leaves it behind, to be removed as other parts are.
    """

    def __init__(self, target: Path) -> None:
        """Raises OSError if there is no room for it on a file system that knows no links."""
        self._target = target
        self._path = name_part(target, "pass")
        self._disk = -1
        self._path.unlink(missing_ok=True)
        try:
            os.link(target, self._path)
        except OSError:  # no links on this file system
            shutil.copyfile(target, self._path)

    def hold(self) -> None:
        """From now on it is not stale, once the target is another file."""
        self._disk = os.open(self._path, os.O_RDWR | os.O_CLOEXEC)
        lock(self._disk)

    def restore(self, reasons: Mapping[str, str]) -> None:
        """Put it back in the place of the pass that failed, with the attributes that say why."""
        self._release()
        with change_file(self._path) as file:
            file.attrs.update(reasons)
            if not reasons:  # it is the last one
                file.attrs.pop(MAY_FOLLOW, None)
        self._path.replace(self._target)

    def drop(self) -> None:
        """The next pass is finished, or can be gone on with."""
        self._release()
        with suppress(OSError):
            self._path.unlink(missing_ok=True)

    def _release(self) -> None:
        if self._disk >= 0:
            os.close(self._disk)
            self._disk = -1
