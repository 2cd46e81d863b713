"""Where a result file or a picture may be written: checked before anything is computed."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from pbem.errors import ResultFileError

PICTURE_FORMATS = (".png", ".pdf", ".svg")


def check_output_path(path: str | os.PathLike[str]) -> Path:
    """The path of a result file to be written, if its folder exists and it can be written there.

    Raises ResultFileError otherwise. Nothing is left behind, and a file that is there already is left as it is.
    """
    target = Path(path)
    folder = target.parent
    if not folder.is_dir():
        raise ResultFileError(str(path), f"the folder {folder} does not exist")
    if target.is_dir():
        raise ResultFileError(str(path), "is a folder; name a file in it")
    if target.exists() and not target.is_file():
        raise ResultFileError(str(path), "is not a regular file")
    # Tried, not asked: permissions do not tell of read-only file systems, nor of what root may not do.
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise ResultFileError(str(path), f"the folder {folder} is not writable ({error.strerror})") from error
    try:
        if target.exists():
            target.open("ab").close()
    except OSError as error:
        raise ResultFileError(str(path), f"is there already and is not writable ({error.strerror})") from error
    return target


def check_picture_path(path: str | os.PathLike[str]) -> Path:
    """As `check_output_path`, for a picture; its ending says the format."""
    if Path(path).suffix.lower() not in PICTURE_FORMATS:
        raise ResultFileError(str(path), f"is no picture; its name should end with {', '.join(PICTURE_FORMATS)}")
    return check_output_path(path)
