"""PETSc's own account of a run (-pbem_log_view): its stages and events are the pieces of pbem.clock."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from pbem.clock import WITHIN, clock
from pbem.errors import CaseError, ConvergenceError, Fault, StopError
from pbem.solve.petsc.session import LOG_OPTION, PREFIX, REST, PETSc, begin_log


class PetscLog:
    """A stage and an event for every outer piece and for the rest, an event for every piece within.

    file: where it goes, "" is standard output.

    In PETSc's account an event has the time of those within it, in the clock's it has not.
    """

    def __init__(self) -> None:
        self.file: str | None = None

    def obey(self, source: str, options: Mapping[str, str]) -> None:
        """Begin if the options ask for it, unless an account is being kept; source: the case, for what is said.
        All ranks together.

        Raises CaseError for a value that is neither empty nor ":FILE".
        """
        value = options.get(LOG_OPTION)
        if value is None or clock.listener is not None:
            return
        kind, _, file = value.partition(":")
        if kind not in ("", "ascii") or ":" in file:
            raise CaseError(source, (Fault(f"-{PREFIX}{LOG_OPTION}", f'"{value}"', "no value, or :FILE"),))
        self.file = file
        begin_log()
        clock.listener = self

    def enter(self, path: tuple[str, ...]) -> None:
        """See pbem.clock.Listener."""
        if len(path) == 1:
            PETSc.Log.Event(REST).end()
            PETSc.Log.Stage(f"pbem {path[0]}").push()
        _find_event(path).begin()

    def leave(self, path: tuple[str, ...]) -> None:
        """See pbem.clock.Listener."""
        _find_event(path).end()
        if len(path) == 1:
            PETSc.Log.Stage(f"pbem {path[0]}").pop()
            PETSc.Log.Event(REST).begin()

    def show(self) -> None:
        """Write the account, if it was asked for. All ranks together."""
        if self.file is None:
            return
        self.leave_off()
        # It goes on for a further run of the same process.
        PETSc.Log.Event(REST).end()
        viewer = PETSc.Viewer().createASCII(self.file or "stdout", "w", comm=PETSc.COMM_WORLD)
        PETSc.Log.view(viewer)
        viewer.destroy()
        PETSc.Log.Event(REST).begin()


    def leave_off(self) -> None:
        """No more is kept from now on; what was stays."""
        if clock.listener is self:
            clock.listener = None


def _find_event(path: tuple[str, ...]) -> PETSc.Log.Event:
    return PETSc.Log.Event(f"pbem {WITHIN.join(path)}")


@contextmanager
def petsc_log(source: str, options: Mapping[str, str]) -> Iterator[PetscLog]:
    """The account of the block, which is shown at its end if the options ask for it; the case's may ask later."""
    log = PetscLog()
    log.obey(source, options)
    try:
        yield log
    except (ConvergenceError, StopError):  # all ranks alike
        log.show()
        raise
    finally:
        log.leave_off()
    log.show()
