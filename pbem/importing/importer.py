"""Files of other programs, by their kind, to the text of a case."""

from __future__ import annotations

import os
from pathlib import Path

from pbem.case.reader import add_lines, parse_draft
from pbem.errors import CaseError, PbemError
from pbem.importing.csv_file import read_csv
from pbem.importing.dxf_file import read_dxf
from pbem.importing.geojson_file import read_geojson
from pbem.importing.map_case import make_map_case
from pbem.importing.mesh_case import make_mesh_case
from pbem.importing.msh_file import read_mesh
from pbem.importing.options import Imported, Options
from pbem.importing.reading import Reading, fail, read_text
from pbem.model.build import examine
from pbem.wording import list_names

KINDS = (".geojson", ".json", ".csv", ".txt", ".dxf", ".msh")


def import_file(path: Path, options: Options, command: str) -> Imported:
    """The case of a file. Raises PbemError with what is wrong with it, and where."""
    kind = path.suffix.lower()
    if kind not in KINDS:
        raise PbemError(f"{path}: found a file name that ends in '{path.suffix}'; expected {list_names(KINDS)}")
    if not os.path.isfile(path):
        what = "a folder" if os.path.isdir(path) else "no such file"
        raise PbemError(f"{path}: found {what}; expected a file of traces or a mesh")
    if kind == ".msh":
        imported = make_mesh_case(path, read_mesh(path), options, command)
    else:
        reading = _read(path, kind)
        imported = make_map_case(path, reading, options, command)
    _check(path, imported)
    return imported


def _read(path: Path, kind: str) -> Reading:
    if kind == ".dxf":
        return read_dxf(path)
    return (read_csv if kind in (".csv", ".txt") else read_geojson)(path, read_text(path))


def _check(path: Path, imported: Imported) -> None:
    """Refuse what `pbem check` would refuse."""
    draft = parse_draft(imported.text, str(path))
    faults = list(draft.faults)
    if draft.case is not None:
        faults += add_lines(examine(draft.case, draft.conditions_known)[1], draft.lines)
    if faults:
        error = fail(path, faults)
        raise CaseError(f"the case that would be made of {path}", error.faults)
