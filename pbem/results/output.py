"""Where a result file or a picture may be written: checked before anything is computed."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterable
from pathlib import Path

from pbem.errors import ResultFileError
from pbem.results.opening import open_quietly, refuse_damage
from pbem.results.tail import SIGNATURE
from pbem.results.trial import check_contents

PICTURE_FORMATS = (".png", ".pdf", ".svg")
MOVIE_FORMATS = (".gif", ".mp4")


def check_output_path(
    path: str | os.PathLike[str], *, resume: bool = False, force: bool = False, source: str | None = None,
    overrides: str = "", inputs: Iterable[str | os.PathLike[str]] = (),
) -> Path:
    """The path of a result file to be written, if its folder exists and it can be written there.

    resume: a file that is there is to be gone on with; force: it may be replaced, if it is a result file. source: text
    of the case, and overrides: values set beside it, to say whether a file that is there belongs to it. inputs: files
    that are read, and never replaced.

    Raises ResultFileError otherwise. Nothing is left behind, and a file that is there already is left as it is.
    """
    target = _check_folder(path)
    for each in inputs:
        if target.exists() and Path(each).exists() and target.samefile(each):
            raise ResultFileError(str(path), f"is the file {each} that the case is read from; name another output file")
    if resume and force:
        raise ResultFileError(str(path), "cannot be both resumed and replaced; choose one of --resume and --force")
    if resume and not target.exists():
        raise ResultFileError(str(path), "there is no such file to resume; run without resuming")
    if target.exists() and not resume:
        _refuse_to_replace(target, force, source, overrides)
    try:
        if target.exists():
            target.open("ab").close()
    except OSError as error:
        raise ResultFileError(str(path), f"is there already and is not writable ({error.strerror})") from error
    return target


def _check_folder(path: str | os.PathLike[str]) -> Path:
    """The path of a regular file that is there or can be made; links are followed."""
    if "\0" in str(path):
        raise ResultFileError(str(path), "is no file name")
    target = Path(path)
    try:
        target = Path(os.path.realpath(path)) if target.is_symlink() else target
        folder = target.parent
        if not folder.is_dir():
            raise ResultFileError(str(path), f"the folder {folder} does not exist")
        if target.is_dir():
            raise ResultFileError(str(path), "is a folder; name a file in it")
        if target.exists() and not target.is_file():
            raise ResultFileError(str(path), "is not a regular file")
    except OSError as error:  # a name that is too long, a folder that may not be read
        raise ResultFileError(str(path), f"cannot be written ({error.strerror})") from error
    # Tried, not asked: permissions do not tell of read-only file systems, nor of what root may not do.
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise ResultFileError(str(path), f"the folder {folder} is not writable ({error.strerror})") from error
    return target


def _refuse_to_replace(target: Path, force: bool, source: str | None, overrides: str) -> None:
    """Raise ResultFileError unless the file that is there may be replaced: it is a result file, and force is set."""
    try:
        with refuse_damage(target):
            check_contents(target)
        with open_quietly(target) as file:
            known = "pbem_version" in file.attrs
            told = (file.attrs.get("case"), file.attrs.get("overrides", ""))
            other = known and source is not None and told != (source, overrides)
    except ResultFileError:  # cut off or damaged
        with target.open("rb") as file:
            known, other = file.read(len(SIGNATURE)) == SIGNATURE, False
    if not known:
        raise ResultFileError(str(target), "exists already and is not a result file of pbem; name another output file")
    if not force:
        what = "the results of another case, or of this case before it was changed" if other else "results"
        go_on = "" if other else "--resume goes on with them, "
        raise ResultFileError(
            str(target), f"holds {what}; {go_on}--force replaces them, -o names another file"
            + (" (--resume is for results of the same case, or of its first stages)" if other else "")
        )


def check_export_path(path: str | os.PathLike[str], source: str | os.PathLike[str]) -> Path:
    """As `check_output_path`, for what is made of a result file, which it must not replace, nor another."""
    target = _check_folder(path)
    if target.exists():
        with target.open("rb") as file:
            stored = file.read(len(SIGNATURE)) == SIGNATURE
        if Path(source).exists() and target.samefile(source):
            raise ResultFileError(str(path), "is the result file itself; name another file")
        if stored:
            _refuse_results(target)
        try:
            target.open("ab").close()
        except OSError as error:
            raise ResultFileError(str(path), f"is there already and is not writable ({error.strerror})") from error
    return target


def _refuse_results(target: Path) -> None:
    try:
        with open_quietly(target) as file:
            known = "pbem_version" in file.attrs
    except ResultFileError:
        known = False
    if known:
        raise ResultFileError(str(target), "holds the results of a run; name another file")


def check_picture_path(path: str | os.PathLike[str], *, movies: bool = False) -> Path:
    """As `check_output_path`, for a picture, or an animation (`movies`); its ending says the format."""
    known = PICTURE_FORMATS + (MOVIE_FORMATS if movies else ())
    if Path(path).suffix.lower() not in known:
        raise ResultFileError(str(path), f"is no picture; its name should end with {', '.join(known)}")
    target = _check_folder(path)
    if target.exists():
        try:
            target.open("ab").close()
        except OSError as error:
            raise ResultFileError(str(path), f"is there already and is not writable ({error.strerror})") from error
    return target
