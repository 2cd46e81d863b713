"""The command `pbem import`: its options, and the case file that it writes."""

from __future__ import annotations

import argparse
import math
import shlex
from dataclasses import fields
from pathlib import Path

from pbem.errors import PbemError, printable
from pbem.make_command import read_finite

# The libraries of the formats are imported where they are used, so that help comes at once.

NOTES = """\
FILE: .geojson, .csv (rows x1,y1,x2,y2 or id,x,y), .dxf: traces, which become cracks of the whole plane, cut where they
cross or meet; .msh of gmsh (2.2 or 4.1): physical surfaces become regions, physical lines curves.
All changes (joined, cut, dropped, moved) are listed, also in the first comment of the case: `pbem help import`"""


def add_import_options(parser: argparse.ArgumentParser) -> None:
    """The options of the command."""
    add = parser.add_argument
    add("file", metavar="FILE")
    add("-o", "--output", required=True, metavar="CASE.toml", help="case file to be written")
    add("--force", action="store_true", help="write over a file that is there")
    add("--size", type=_read_positive, metavar="H", help="largest element length (default: a sixth of the median "
        "length of the traces; for a mesh its own)")
    add("--snap", type=_read_distance, metavar="D",
        help="points within this distance coincide (default: a thousandth of the median length)")
    add("--simplify", type=_read_distance, metavar="D",
        help="remove vertices as long as no trace moves by more than this (default: 0)")
    add("--keep-junctions", action="store_true",
        help="cut the traces before they are simplified, and simplify what lies between their junctions")
    add("--friction", type=read_finite, metavar="F", help="friction coefficient of all traces (default: 0.6)")
    add("--young", type=read_finite, metavar="E", help="Young's modulus (default: 1000)")
    add("--poisson", type=read_finite, metavar="P", help="Poisson's ratio (default: 0.2)")
    add("--sxx", type=read_finite, metavar="S", help="stress far away (default: 0)")
    add("--syy", type=read_finite, metavar="S", help="(default: -1, or 0 if another component is given)")
    add("--sxy", type=read_finite, metavar="S", help="(default: 0)")


def _read_positive(text: str) -> float:
    value = read_finite(text)
    if not value > 0:
        raise argparse.ArgumentTypeError(f"found {text!r}; expected a length above 0")
    return value


def _read_distance(text: str) -> float:
    value = read_finite(text)
    if value < 0 or math.isnan(value):
        raise argparse.ArgumentTypeError(f"found {text!r}; expected a length, 0 or more")
    return value


def import_case(options: argparse.Namespace) -> str:
    """Write the case file that the options of the command line ask for; returns what is said of it.

    Raises PbemError for a file that cannot be read as it should be, or for one that is there already.
    """
    from pbem.importing.importer import import_file
    from pbem.importing.listing import describe
    from pbem.importing.options import Options

    target = Path(options.output)
    if target.exists() and not options.force:
        raise PbemError(f"{target} is there already; --force writes over it")
    if not target.parent.is_dir():
        raise PbemError(f"{target}: there is no folder '{target.parent}'")
    asked = Options(**{each.name: getattr(options, each.name) for each in fields(Options)})
    command = printable(shlex.join(["pbem", *options.arguments]))
    imported = import_file(Path(options.file), asked, command)
    try:
        target.write_text(imported.text, encoding="utf-8")
    except OSError as error:
        raise PbemError(f"{target}: {error.strerror or error}") from None
    return describe(imported, str(target))
