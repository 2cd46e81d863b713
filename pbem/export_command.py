"""`pbem export`: a result file for ParaView and PyVista, or a table."""

from __future__ import annotations

import argparse
from pathlib import Path

from pbem.errors import ExportError

VTK, TABLE = (".vtkhdf", ".hdf"), (".csv",)
NOTES = """\
  pbem export run.h5                      run.vtkhdf: all stored steps for ParaView and PyVista (`pbem help paraview`)
  pbem export run.h5 --copy               the same without references to run.h5
  pbem export run.h5 -o run.csv           the contact of all interfaces
  pbem export run.h5 -o seat.csv --what contact.seat

Tables: contact.NAME, contact (of all interfaces), reactions, rigid, tips, interior, steps; a row for each stored step
and pair, curve, rigid body, tip or point; numbers with all their digits, empty where they are not known."""


def add_export_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of `pbem export`."""
    parser.add_argument("file", metavar="FILE.h5")
    parser.add_argument("-o", "--output", metavar="FILE",
                        help="a name ending with .vtkhdf (default: that of the result file) or .csv")
    parser.add_argument("--what", metavar="TABLE",
                        help="of a .csv: contact.NAME, contact, reactions, rigid, tips, interior or steps "
                             "(default: contact)")
    parser.add_argument("--copy", action="store_true",
                        help="of a .vtkhdf: copy all arrays, also where it could refer to the result file")


def export(options: argparse.Namespace) -> str:
    """Write the file; what to say of it. Raises ExportError or ResultFileError; nothing was written then."""
    target = Path(options.output or Path(options.file).with_suffix(".vtkhdf"))
    kind = target.suffix.lower()
    faults = []
    if kind not in VTK + TABLE:
        faults.append(f"-o: found {target.name}; expected a name that ends with .vtkhdf or .csv")
    elif kind in VTK and options.what is not None:
        faults.append(f"--what: found {options.what} for {target.name}; expected it with a name that ends with .csv")
    elif kind in TABLE and options.copy:
        faults.append(f"--copy: found it for {target.name}; expected it with a name that ends with .vtkhdf")
    if faults:
        raise ExportError("\n".join(f"export: {fault}" for fault in faults))

    from pbem.results.output import check_export_path
    from pbem.results.reader import open_results

    results = open_results(options.file)
    target = check_export_path(target, options.file)
    if kind in TABLE:
        from pbem.results.tables import choose_table, make_table, write_csv

        what = options.what or choose_table(results)
        table = make_table(results, what)
        write_csv(table, target)
        rows = len(next(iter(table.values())))
        return f"table: {target}: {what}, {rows} row{'s' * (rows != 1)}, columns {', '.join(table)}"
    from pbem.results.vtkhdf import export_vtkhdf

    made = export_vtkhdf(results, target, options.copy)
    refers = f"; refers to {options.file} for most arrays (--copy: for none)" if made.refers else ""
    steps = f"{made.steps} step{'s' * (made.steps != 1)}"
    return f"for ParaView: {target}: {steps}, blocks {', '.join(made.blocks)}{refers}"
