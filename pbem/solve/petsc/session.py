"""The door to PETSc: how it is started, and the options that users and the program give it."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

import petsc4py

# Signals are the shell's and MPI's business: with PETSc's handlers a closed pipe would look like a crash.
petsc4py.init(["pbem", "-no_signal_handler"])
from petsc4py import PETSc  # noqa: E402

PREFIX = "pbem_"
# Of PETSc's own account of time; what no piece of a run has is in a stage of this name.
LOG_OPTION, REST = "log_view", "pbem start and other"
_logs: list[PETSc.Log.Stage] = []


def begin_log() -> None:
    """Let PETSc keep its account from now on, if it does not yet."""
    if not _logs:
        PETSc.Log.begin()
        _logs.append(PETSc.Log.Stage(REST))
        _logs[0].push()
        PETSc.Log.Event(REST).begin()


if any(argument.startswith(f"-{PREFIX}{LOG_OPTION}") for argument in sys.argv):
    begin_log()  # before anything else is loaded, which takes its time

NOT_CONVERGED = 91


def petsc_version() -> str:
    """Version of the PETSc library in use."""
    return ".".join(str(part) for part in PETSc.Sys.getVersion())


@contextmanager
def pass_over_divergence() -> Iterator[None]:
    """Leave to the caller what the option ksp_error_if_not_converged makes an error: it asks for the reason itself."""
    try:
        yield
    except PETSc.Error as error:
        if error.ierr != NOT_CONVERGED:
            raise


@contextmanager
def petsc_options(options: Mapping[str, str]) -> Iterator[None]:
    """Hold options in PETSc's database under the program's prefix while the block runs."""
    database = PETSc.Options()
    for name, value in options.items():
        database.setValue(PREFIX + name, value)
    try:
        yield
    finally:
        for name in options:
            database.delValue(PREFIX + name)


def list_options() -> list[str]:
    """Names of the options that PETSc's database holds under the program's prefix."""
    return list(PETSc.Options(PREFIX).getAll())


def list_factor_options() -> list[str]:
    """Those of them that a solver or its factors may heed: not those of PETSc's account, nor the program's own."""
    return [name for name in list_options() if name.startswith(("ksp_", "pc_", "mat_"))]


def find_number(name: str, default: float) -> float:
    """The value of an option of the program's own under its prefix."""
    return float(PETSc.Options(PREFIX).getReal(name, default))


@contextmanager
def factor_in_place(wanted: bool) -> Iterator[None]:
    """Let the factors take the matrix's storage; petsc4py knows this by an option only."""
    database, name = PETSc.Options(), PREFIX + "pc_factor_in_place"
    if not wanted or database.hasName(name):
        yield
        return
    database.setValue(name, "1")
    try:
        yield
    finally:
        database.delValue(name)
