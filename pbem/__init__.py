"""pbem: boundary elements for frictional contact in two-dimensional elasticity.

Sign conventions. The plane is x (right), y (up). Stress and traction are positive in tension; the normal of a region
points outwards, and its boundary is traversed with the region on the left. A contact pair has a
first side r and a second side l; n is the outward normal of the first side and s is n turned by +90 degrees:

    opening  g_n = (u_l - u_r) . n + gap  >= 0
    slip     g_s = (u_l - u_r) . s
    traction p   = traction on the first side; p_n <= 0 in compression; the second side carries -p

Inside the program a point or a vector of the plane is one complex number x + iy. Docstrings and comments cite formulas
as (theory, 12): formula 12 of `pbem help theory`.

    results = pbem.run("case.toml")              # run a case; see pbem.driver.run
    case = pbem.Case(materials={...}, ...)       # a case made in Python; see pbem.case.case.Case
    table = pbem.sweep(case, {"interfaces.seat.friction": [0.1, 0.2]})    # many cases; see pbem.sweeps.sweep.sweep
    results = pbem.open_results("case.h5")       # read a result file; see pbem.results.reader.open_results
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from pbem.version import __version__

if TYPE_CHECKING:
    from pbem.case.case import Case
    from pbem.driver import run
    from pbem.errors import (
        CaseError,
        ConvergenceError,
        ExportError,
        LaunchError,
        LawError,
        PbemError,
        PlotError,
        ResultFileError,
        StopError,
        StorageError,
    )
    from pbem.results.reader import open_results
    from pbem.sweeps.sweep import sweep

__all__ = [
    "Case", "CaseError", "ConvergenceError", "ExportError", "LaunchError", "LawError", "PbemError", "PlotError",
    "ResultFileError",
    "StopError", "StorageError", "__version__", "open_results", "run", "sweep",
]

# Looked up at first use: whoever imports the package for something else waits for neither MPI nor HDF5, and the command
# line is soon where an interruption is reported as one (pbem.__main__).
_AT_FIRST_USE = {
    "Case": "pbem.case.case", "run": "pbem.driver", "open_results": "pbem.results.reader", "sweep": "pbem.sweeps.sweep",
    **{name: "pbem.errors" for name in __all__ if name.endswith("Error")},
}


def __getattr__(name: str) -> Any:
    if name == "errors":  # the module, which `pbem.errors.CaseError` asks for
        return import_module("pbem.errors")
    if name not in _AT_FIRST_USE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from pbem.loading import load_at_once

    with load_at_once():
        value = globals()[name] = getattr(import_module(_AT_FIRST_USE[name]), name)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_AT_FIRST_USE})
