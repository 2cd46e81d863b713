"""The cases that come with the program, found by their names."""

from __future__ import annotations

import difflib
import os.path
from pathlib import Path

from pbem.errors import CaseError, Fault

GALLERY = "gallery/"


def find_case(name: str) -> Path:
    """The path of a case: a file, or the name of one that comes with the program (with or without .toml).

    Cases of the gallery go by `gallery/NAME` and by NAME. Raises CaseError if there is neither, with the names of those
    that there are.
    """
    if os.path.isfile(name):  # also of names that no file can have
        return Path(name)
    found = find_bundled(name)
    if found is not None:
        return found
    bundled, stem = list_bundled_cases(), name.removesuffix(".toml")
    names = [each.removeprefix(GALLERY) for each in bundled]
    near = difflib.get_close_matches(stem.removeprefix(GALLERY), names, n=1, cutoff=0.6)
    hint = f" (did you mean '{near[0]}'?)" if near else ""
    raise CaseError(name, (Fault("CASE", f"'{name}', which is no file", _describe_cases(bundled) + hint),))


def locate(source: str | os.PathLike[str]) -> Path:
    """The path of a file, or of a case of the program where there is no file but one of that name among them.

    What is written as a path, or with a suffix, means a file: mistyped it must not become another problem.
    """
    path = Path(source)
    named = isinstance(source, str) and not source.endswith(".toml") and not os.path.isfile(path)
    return (find_bundled(source) if named else None) or path  # type: ignore[arg-type]


def find_bundled(name: str) -> Path | None:
    """The path of a case that comes with the program, None where there is none of this name."""
    bundled, stem = list_bundled_cases(), name.removesuffix(".toml")
    return bundled.get(stem, bundled.get(GALLERY + stem))


def _describe_cases(bundled: dict[str, Path]) -> str:
    """What names a case: those of the gallery are on their page."""
    if not bundled:
        return "a case file"
    own = [name for name in bundled if not name.startswith(GALLERY)]
    gallery = " or of `pbem help gallery`" if len(own) < len(bundled) else ""
    return f"a case file or one of the cases of the program{gallery}: {', '.join(own)}"


def list_bundled_cases() -> dict[str, Path]:
    """The cases that come with the program, by name: in the package, or beside it in a checkout.

    Those of the gallery are named gallery/NAME, and come last.
    """
    package = Path(__file__).resolve().parent
    for folder in (package / "cases", package.parent / "cases"):
        cases = {path.stem: path for path in sorted([*folder.glob("*.toml"), *folder.glob("networks/*.toml")])}
        if cases:
            return cases | {GALLERY + path.stem: path for path in sorted((folder / "gallery").glob("*.toml"))}
    return {}
