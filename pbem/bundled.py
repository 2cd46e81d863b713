"""The cases that come with the program, found by their names."""

from __future__ import annotations

import difflib
import os.path
from pathlib import Path

from pbem.errors import CaseError, Fault


def find_case(name: str) -> Path:
    """The path of a case: a file, or the name of one that comes with the program (with or without .toml).

    Raises CaseError if there is neither, with the names of those that there are.
    """
    if os.path.isfile(name):  # also of names that no file can have
        return Path(name)
    bundled = list_bundled_cases()
    stem = name.removesuffix(".toml")
    if stem in bundled:
        return bundled[stem]
    near = difflib.get_close_matches(stem, bundled, n=1, cutoff=0.6)
    hint = f" (did you mean '{near[0]}'?)" if near else ""
    expected = f"a case file or one of the cases of the program: {', '.join(bundled)}" if bundled else "a case file"
    raise CaseError(name, (Fault("CASE", f"'{name}', which is no file", expected + hint),))


def list_bundled_cases() -> dict[str, Path]:
    """The cases that come with the program, by name: in the package, or beside it in a checkout."""
    package = Path(__file__).resolve().parent
    for folder in (package / "cases", package.parent / "cases"):
        cases = {path.stem: path for path in sorted(folder.glob("*.toml"))}
        if cases:
            return cases
    return {}
