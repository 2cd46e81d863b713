"""PETSc's own account of a run (-pbem_log_view): its stages and events are the pieces of pbem.clock."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from pbem.clock import WITHIN, clock
from pbem.errors import LaunchError
from pbem.solve.petsc.session import PETSc

OPTION = "log_view"


class PetscLog:
    """A stage for every outer piece, an event for every piece; PETSc adds up those within, the clock does not."""

    def enter(self, path: tuple[str, ...]) -> None:
        """See pbem.clock.Listener."""
        if len(path) == 1:
            PETSc.Log.Stage(f"pbem {path[0]}").push()
        _find_event(path).begin()

    def leave(self, path: tuple[str, ...]) -> None:
        """See pbem.clock.Listener."""
        _find_event(path).end()
        if len(path) == 1:
            PETSc.Log.Stage(f"pbem {path[0]}").pop()


def _find_event(path: tuple[str, ...]) -> PETSc.Log.Event:
    return PETSc.Log.Event(f"pbem {WITHIN.join(path)}")


@contextmanager
def petsc_log(options: Mapping[str, str]) -> Iterator[None]:
    """Log the block and show it at its end if the option asks for it: on standard output, or in the file ":FILE".

    Collective. Raises LaunchError for a value that is none of these.
    """
    value = options.get(OPTION)
    if value is None:
        yield
        return
    kind, _, file = value.partition(":")
    if kind not in ("", "ascii", "1", "true") or ":" in file:
        raise LaunchError(f"-pbem_{OPTION} {value}: expected no value, or :FILE")
    PETSc.Log.begin()
    clock.listener = PetscLog()
    try:
        yield
    finally:
        clock.listener = None
    # Not after an exception: one rank alone would wait here for the others.
    viewer = PETSc.Viewer().createASCII(file, "w", comm=PETSc.COMM_WORLD) if file else PETSc.Viewer.STDOUT()
    PETSc.Log.view(viewer)
    if file:
        viewer.destroy()
