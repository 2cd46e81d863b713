"""The result file of a pass: opened, and closed however the pass ends."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import TypeVar

from pbem.arrays import Integer
from pbem.clock import clock
from pbem.errors import ConvergenceError, PbemError, StopError
from pbem.mesh.mesh import Mesh
from pbem.model.model import Model
from pbem.parallel import Comm, alone, do_on_first, lacks_memory
from pbem.passes import Target, blame_pass
from pbem.results.accuracy import Pass
from pbem.results.passes import KeptPass, PassOutput, holds_steps, open_beside
from pbem.results.tip_shape import Derived
from pbem.results.tips import collect_tip_rules
from pbem.results.writer import ResultWriter
from pbem.solve.petsc.session import petsc_version

Written = TypeVar("Written")


@dataclass(frozen=True)
class PassFile:
    """What the file of a pass begins with; region: of the interior points; beside: the former pass has a file, which is
    kept until this one is finished; notes: what is told of the pass, which grows as it goes on."""

    model: Model
    mesh: Mesh
    target: Target
    options: Mapping[str, str]
    region: Integer | None
    one: Pass
    beside: bool
    notes: dict[str, None] = field(default_factory=dict)


def write_pass(file: PassFile, comm: Comm, work: Callable[[ResultWriter | None], Written]) -> Written:
    """Do something with the open file, which the first rank alone has; by all ranks together."""
    one = file.one
    with clock.piece("writing"):
        # While the first rank writes what the file begins with the others derive what it needs with the first step.
        derived = _derive_tip_forms(file, comm)
        output = do_on_first(comm, PbemError, lambda: _open(file, comm.size), share=False) or PassOutput()
    if output.writer:
        output.writer.notes = file.notes
    try:  # from here on whatever happens has to leave a closed file
        with clock.piece("writing"):
            for each in comm.gather(derived, root=0) or ():
                expect_writer(output.writer).tip_rules.take(each)
        found = work(output.writer)
    except BaseException as error:
        first = one.number == 1 or one.spare or file.target.resume
        told = error if first else blame_pass(error, one, 2 * file.mesh.nodes)
        if output.writer:
            _end_badly(output.writer, told, output.former, one.spare)
        if told is error:
            raise
        raise told from error
    with clock.piece("writing"):
        if output.former:
            output.former.drop()
        comm.Barrier()
    return found


def _derive_tip_forms(file: PassFile, comm: Comm) -> Mapping[int, Derived]:
    """On every rank but the first its share of the forms by which values at tips follow from a step, by number."""
    if comm.rank == 0:
        return {}
    return collect_tip_rules(file.model, file.mesh).derive(slice(comm.rank - 1, None, comm.size - 1))


def _open(file: PassFile, ranks: int) -> PassOutput:
    """The result file to go on with, or a new one beside which the former pass is kept, if there is a file of it."""
    model, mesh, target, region = file.model, file.mesh, file.target, file.region
    flat = [f"{name}={value}" for name, value in file.options.items()]
    if target.resume:
        return PassOutput(ResultWriter.resume(target.path, model, mesh, ranks, petsc_version(), flat, region))

    def create() -> ResultWriter:
        return ResultWriter(target.path, model, mesh, ranks, petsc_version(), flat, region, force=target.force)

    return open_beside(target.path, create) if file.beside else PassOutput(create())


def _end_badly(writer: ResultWriter, error: BaseException, former: KeptPass | None, spare: bool) -> None:
    """Close the file. A pass that was stopped can be gone on with, one that has failed gives way to the former one."""
    reached = isinstance(error, ConvergenceError) and error.reason == "accuracy"
    stopped = isinstance(error, StopError | KeyboardInterrupt) and writer.steps_stored > 0
    reasons = writer.abandon(_name_lack(error))
    if former and (reached or stopped):
        former.drop()
    elif former:
        with suppress(PbemError, OSError):  # what ended the run must be what the user hears of
            former.restore({} if spare and isinstance(error, ConvergenceError) else reasons)


def _name_lack(error: BaseException) -> BaseException:
    """PETSc and what lies below it have errors of their own for want of memory."""
    return MemoryError(" ".join(str(error).split())) if lacks_memory(error) else error


def keep_waiting(
    file: PassFile, comm: Comm, error: BaseException, store: Callable[[ResultWriter | None, Comm], object]
) -> None:
    """Store what a finished pass came to after an exception has ended the next one, and in the file's attributes why.

    store: does that, by all ranks of its communicator together. An error that one rank may have alone is none for
    calls of all: then the first rank stores by itself. A later pass that was stopped after steps can be gone on with,
    and stays in the file.
    """
    ranks, together = comm.size, comm.size == 1 or isinstance(error, PbemError)
    if not together and comm.rank > 0:
        return
    comm = comm if together else alone
    target = Target(file.target.path, False, True)
    # What ended the run must be what the user hears of.
    with suppress(PbemError if comm.size > 1 else Exception):
        stopped = isinstance(error, StopError | KeyboardInterrupt)
        if stopped and do_on_first(comm, PbemError, lambda: holds_steps(target.path)):
            return
        again = replace(file, target=target, beside=False)
        writer = (do_on_first(comm, PbemError, lambda: _open(again, ranks), share=False) or PassOutput()).writer
        if writer:
            writer.notes = file.notes
        try:
            store(writer, comm)
        finally:
            if writer:
                writer.abandon(_name_lack(error), "on a mesh graded towards ends of contact; these are the steps of "
                                                  f"the mesh before, of {2 * file.mesh.nodes} unknowns")


def expect_writer(writer: ResultWriter | None) -> ResultWriter:
    """On the first rank."""
    assert writer is not None, "the first rank writes"
    return writer
