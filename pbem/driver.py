"""A run from the case to the finished results, on the ranks of an MPI communicator."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain, islice
from pathlib import Path
from typing import Any

from pbem.case.build import Source, find_file, make_checked_model
from pbem.case.changed import Label, label_key
from pbem.clock import clock
from pbem.description.case import UNNAMED
from pbem.errors import CaseError, ConvergenceError, Fault, PbemError, StopError
from pbem.mesh.generate import generate_mesh
from pbem.mesh.mesh import Mesh
from pbem.model.end_grading import MOST_UNKNOWNS, ContactEnd, may_be_graded
from pbem.model.model import Model, Operator
from pbem.parallel import (
    Comm,
    StopSignals,
    abort_if_unexpected,
    broadcast,
    check_communicator,
    do_on_first,
)
from pbem.pass_file import PassFile, expect_writer, keep_waiting, write_pass
from pbem.passes import Finer, Target, blame_tries, plan_finer, plan_graded, recall_mesh
from pbem.results.accuracy import Decision, Pass, decide, refine_marked
from pbem.results.contact_ends import find_contact_ends
from pbem.results.doubts import find_long, find_smooth
from pbem.results.estimator import Estimator
from pbem.results.model_text import describe_size
from pbem.results.output import check_output_path
from pbem.results.overrides import choose_overrides
from pbem.results.passes import expect_no_pass, read_refinement
from pbem.results.reader import Results, open_results
from pbem.results.resume import is_finished
from pbem.results.tip_notes import doubt_factors
from pbem.results.writer import ResultWriter
from pbem.solve.launch.account import describe_start
from pbem.solve.launch.arguments import check_arguments
from pbem.solve.launch.memory import check_memory
from pbem.solve.launch.start import check_shares, check_start
from pbem.solve.launch.watch import Watch
from pbem.solve.petsc.log import petsc_log
from pbem.solve.petsc.options import check_options
from pbem.solve.petsc.session import petsc_options
from pbem.solve.problem.step import ContactState, Reporter, SilentReporter, Step
from pbem.solve.steps.former_pass import FormerPass
from pbem.solve.steps.march import free_at_last, march, start_from
from pbem.solve.system.assembly import assemble_problem
from pbem.solve.system.interior import InteriorField
from pbem.solve.system.kept import KeptProblems
from pbem.storing import WaitingSteps, make_estimator, store_steps, store_without_errors


def run(
    case: Source,
    output: str | os.PathLike[str] | None = None,
    *,
    resume: bool = False,
    force: bool = False,
    petsc: Mapping[str, str] | None = None,
    operator: Operator | None = None,
    reporter: Reporter | None = None,
    set: Mapping[str, Any] | None = None,
    comm: Comm | None = None,
    label: Label = label_key,
    kept: KeptProblems | None = None,
) -> Results:
    """Run a case and return its results.

    case: path of a TOML file, name of a case of the program, a pbem.Case, or its tables as a dictionary. output: path
    of the result file; by default the name of the case file with .h5 (case.h5 if there is none), in the working
    directory. resume: continue after the last step in the file. force: replace existing results; without either, an
    existing file is refused. petsc: PETSc options without prefix, which override the [petsc] table of the case.
    operator: "auto", "dense" or "hierarchical", overrides solver.operator of the case; it is stored in the
    configuration in the result file. reporter: receives the progress, on the first rank only. set: values to override,
    as in `Case.replace`; the result file stores them separately from the case, a resumed run uses the stored values,
    and other values are refused. comm: the MPI communicator whose ranks compute the case together, by default all
    ranks; each of them has to call this and receives the results. With MPI.COMM_SELF each rank computes a separate case
    and writes a separate file. label: function that names set values in messages. kept: operators and factors of
    earlier runs, for cases that share them.

    Raises LaunchError (incompatible ranks, libraries or threads), CaseError (all faults of the case), ResultFileError
    (the output cannot be written, exists already, or belongs to another case), ConvergenceError (the file then holds
    every step reached), StorageError (the disk has no room for a step; the file holds the steps before it), LawError (a
    custom law failed), StopError (stopped by a signal; KeyboardInterrupt for SIGINT). Any other exception on one rank
    ends all ranks, unless the rank computes alone. ValueError: unknown operator. TypeError: comm is not a communicator,
    petsc is not a dictionary, resume or force is neither True nor False, or kept is something else.
    """
    comm = check_communicator(comm)
    check_arguments(operator, petsc, {"resume": resume, "force": force}, reporter=reporter)
    if kept is not None and not isinstance(kept, KeptProblems):
        raise TypeError(f"kept: found {kept!r}; expected what earlier runs of a sweep have kept")
    path = find_file(case)
    name = UNNAMED if path is None else str(path)
    try:
        with (
            abort_if_unexpected(comm, PbemError), StopSignals() as signals, petsc_log(name, petsc or {}) as log
        ):  # fmt: skip
            with clock.piece("start"):
                placement = check_start(comm)
            signals.at_once = comm.size == 1
            target = Path(output) if output is not None else Path("case.h5" if path is None else path.stem + ".h5")
            with clock.piece("reading"):
                model = do_on_first(comm, PbemError, lambda: impose_operator(make_checked_model(
                    case, *(choose_overrides(target, set, label) if resume else (set, label))), name, operator))
                inputs = [*([path] if path else []), *map(Path, model.law_texts)]
                do_on_first(comm, PbemError, lambda: check_output_path(
                    target, resume=resume, force=force, source=model.source, overrides=model.overrides, inputs=inputs))
                do_on_first(comm, PbemError, lambda: check_options(name, model.solver.petsc, petsc or {}))
            watch = Watch(comm, reporter if reporter is not None and comm.rank == 0 else SilentReporter(), signals)
            options = {**model.solver.petsc, **(petsc or {})}
            log.obey(name, options)
            with petsc_options(options):
                _refine_and_solve(model, Target(target, resume, force), options, watch, signals, placement, kept)
            with clock.piece("writing"):
                results = open_results(target)
                for note in do_on_first(comm, PbemError, lambda: doubt_factors(results)):
                    watch.note(note)
            return results
    except StopError as error:
        if error.reason == "SIGINT":  # as without MPI, so that it ends whatever called this
            raise KeyboardInterrupt from error
        raise


def impose_operator(model: Model, name: str, operator: Operator | None) -> Model:
    """The model with this operator in place of its own, if there is one. Raises CaseError if it cannot be."""
    if operator is None:
        return model
    if operator == "hierarchical" and model.solver.linear in ("lu", "mumps"):
        found = f'"{model.solver.linear}" with operator = "hierarchical", which stores no matrix to factor'
        raise CaseError(name, (Fault("solver.linear", found, '"auto" or "gmres", or another operator'),))
    return replace(model, solver=replace(model.solver, operator=operator))


def _refine_and_solve(
    model: Model, target: Target, options: Mapping[str, str], watch: Watch, signals: StopSignals,
    placement: Sequence[str], kept: KeptProblems | None,
) -> None:
    """Solve, and where `analysis.accuracy` asks for it, or contacts do not settle, refine and solve again, from rest.

    Raises ConvergenceError ("accuracy") when passes or unknowns run out; the file then holds the last pass. Of a pass
    that fails otherwise the former one is kept, but for those after contacts that did not settle.
    """
    one = Pass(1, 0)
    if target.resume:
        read = do_on_first(watch.comm, PbemError, lambda: read_refinement(target.path))
        model, one = (model, one) if read is None else (recall_mesh(model, read.fractions, read.finished), read.one)
    notes: Sequence[str] = (*model.notes, *find_smooth(model))
    # Passes for an accuracy count as graded ones, but never are both asked for.
    first, tries, begun, graded = model, 0, one.number, one.number - 1
    former: _Done | None = None
    made: Mesh | None = None
    while True:
        with clock.piece("reading"), _keep_if_ended(former):
            mesh, made = made or generate_mesh(model), None
            check_shares(model, mesh, watch.comm.size)
            remarks = check_memory(watch.comm, model, mesh)
        watch.begin(model)
        anew = one.number == begun and not tries
        for line in (*describe_start(watch.comm), describe_size(model, mesh)) if anew else ():
            watch.tell(line)
        of_mesh = (*mesh.notes, *find_long(model, mesh))
        for note in (*notes, *of_mesh, *placement, *remarks) if anew else ():
            watch.note(note)
        watch.notes = dict.fromkeys((*notes, *model.notes, *of_mesh))  # of the file, not of the machine
        now = replace(one, first_unknowns=one.first_unknowns or 2 * mesh.nodes)
        try:
            with _keep_if_ended(former):
                done = _solve(model, mesh, target, options, watch, signals, now, kept, former, graded)
        except ConvergenceError as error:
            if one.spare:
                text = f"The run on that mesh did not converge ({error.reason}): the results are those before."
                watch.note(text)
                if former and former.store:
                    former.store(None)
                do_on_first(watch.comm, PbemError, partial(expect_no_pass, target.path, (text,)))
                return
            # What was gone on with, and what is kept for other runs, stays on its mesh.
            once = target.resume or kept
            finer = None if once else plan_finer(first, model, 2 * mesh.nodes, tries, error, watch.iterations)
            if finer is None:
                raise blame_tries(error, tries, 2 * mesh.nodes) from error
            watch.note(finer.note)
            model, target, tries, former = finer.model, Target(target.path, False, True), tries + 1, None
            continue
        # The next pass takes the place of this one in the file.
        target = Target(target.path, False, True)
        decision, former = done.decision, done
        one = Pass(one.number + 1, now.first_unknowns, spare=decision.marked is None)
        if decision.marked is not None:
            model = refine_marked(model, decision)
            continue
        planned = done.planned or plan_graded(
            model, decision.ends, graded, 2 * mesh.nodes, watch.iterations, bool(kept))
        if planned:
            watch.note(planned.note)
        if planned is None or planned.model is model:
            if decision.ends:
                do_on_first(watch.comm, PbemError, partial(expect_no_pass, target.path, watch.notes))
            return
        model, made, graded, kept, watch.most = planned.model, planned.mesh, graded + 1, None, planned.most


@dataclass(frozen=True)
class _Done:
    """What a pass has come to: what follows, and its modes. planned: the pass that was found to take its place before
    anything of it was stored; store: does that after all, as the other one came to nothing or an error has ended it."""

    decision: Decision
    modes: FormerPass
    planned: Finer | None = None
    store: Callable[[BaseException | None], None] | None = None


@contextmanager
def _keep_if_ended(former: _Done | None) -> Iterator[None]:
    """Store the former pass if it is not, where an error other than of convergence leaves the block."""
    try:
        yield
    except ConvergenceError:
        raise
    except BaseException as error:
        if former and former.store:
            former.store(error)
        raise


def _solve(
    model: Model, mesh: Mesh, target: Target, options: Mapping[str, str], watch: Watch, signals: StopSignals,
    one: Pass, kept: KeptProblems | None, former: _Done | None, graded: int,
) -> _Done:
    """March through the load history; the first rank writes. graded: see `plan_graded`."""
    with clock.piece("evaluation"):
        interior = InteriorField(model, mesh, watch.comm) if model.interior_points else None
    region = None if interior is None else interior.location.region
    if target.resume and do_on_first(watch.comm, PbemError, lambda: is_finished(target.path, model, mesh)):
        watch.note(f"{target.path} is finished: nothing is left to be computed, and it stays as it is.")
        return _Done(Decision(), FormerPass(mesh))
    watch.check()
    signals.at_once = False  # not between the two halves of what the file and the ranks agree upon

    def store(waiting: WaitingSteps, error: BaseException | None) -> None:
        """What a later pass was to take the place of; error: what has ended that one, None if it came to nothing."""
        if error is not None:
            keep_waiting(file, watch.comm, error, lambda writer, comm: store_without_errors(
                waiting.replay(), model.output_every, interior if comm is watch.comm else None, writer, comm))
            return

        def fill(writer: ResultWriter | None) -> None:
            with waiting.rescue(model.output_every, interior, writer, watch.comm):
                _store(writer, model, mesh, interior, waiting.replay(), watch, signals, one, None, None)

        watch.notes = file.notes
        write_pass(replace(file, target=Target(target.path, False, True), beside=False), watch.comm, fill)

    # What is not stored has no file to be kept.
    beside = one.number > 1 and not (former and former.store)
    file = PassFile(model, mesh, target, options, region, one, beside, watch.notes)
    modes = former.modes if former else None
    return write_pass(file, watch.comm, lambda writer: _fill(
        writer, model, mesh, interior, watch, signals, one, kept, modes, graded, store))


def _fill(
    writer: ResultWriter | None, model: Model, mesh: Mesh, interior: InteriorField | None, watch: Watch,
    signals: StopSignals, one: Pass, kept: KeptProblems | None, former: FormerPass | None, graded: int,
    store: Callable[[WaitingSteps, BaseException | None], None],
) -> _Done:
    """Assemble, march, store the steps as they come, and judge their errors. former: with whose modes to begin. store:
    what to do with steps that are not stored if no other pass takes the place of this one after all."""
    comm = watch.comm
    if model.analysis.accuracy is not None or one.number > 1:
        do_on_first(comm, PbemError, lambda: expect_writer(writer).note_pass(one.number, one.first_unknowns))
    last, unfinished, before = broadcast(
        comm, (writer.last_step, writer.unfinished, writer.former) if writer else (None, None, None))
    signals.at_once = comm.size == 1
    with clock.piece("assembly"):
        problem = kept.assemble(model, mesh) if kept else assemble_problem(model, mesh, comm)
    signals.at_once = False
    watch.look_after(problem.laws)
    watch.check()
    for note in problem.system.notes:
        watch.note(note)
    if interior is not None:
        with clock.piece("evaluation"):
            interior.prepare(problem.system)
    start = None if last is None else start_from(problem, last, before)
    tangent = kept.take_tangent(problem) if kept else None
    guess = former.make_guess(problem) if former else None
    passed = FormerPass(mesh, partial(_find_ends, comm, model, mesh))
    gradable = may_be_graded(model, 2 * mesh.nodes)
    steps = clock.each("steps", march(problem, watch, start, tangent, guess, unfinished=unfinished))
    steps = steps if kept else free_at_last(problem, steps)
    steps = passed.listen(steps) if gradable or model.analysis.accuracy is not None else steps
    if gradable and kept is None and last is None and 2 * mesh.nodes <= MOST_UNKNOWNS:
        waiting = WaitingSteps(steps)
        with waiting.rescue(model.output_every, interior, writer, comm):
            ends = passed.find_last() if waiting.whole else ()
            planned = plan_graded(model, ends, graded, 2 * mesh.nodes, watch.iterations)
            if planned and planned.model is not model:
                if writer:
                    writer.fail("accuracy", "a mesh graded towards ends of contact was to follow", "stopped")
                return _Done(Decision(ends=tuple(ends)), passed, planned, partial(store, waiting))
            if one.spare and isinstance(waiting.error, ConvergenceError):
                watch.check()
                raise waiting.error
            # Who stops a run gets what is known by then, the errors of these steps with it.
            signals = StopSignals() if isinstance(waiting.error, StopError | KeyboardInterrupt) else signals
            steps = waiting.replay()
            return _Done(_store(writer, model, mesh, interior, steps, watch, signals, one, None, None), passed)
    return _Done(_store(writer, model, mesh, interior, steps, watch, signals, one, kept, last), passed)


def _store(
    writer: ResultWriter | None, model: Model, mesh: Mesh, interior: InteriorField | None, steps: Iterator[Step],
    watch: Watch, signals: StopSignals, one: Pass, kept: KeptProblems | None, last: Step | None,
) -> Decision:
    """Store the steps as they come, and judge their errors. last: the step before them, if any."""
    try:
        # Only once the first step is there, as the second mesh takes room as well.
        begun = list(islice(steps, 1))
        with clock.piece("estimate"), _rescue(begun, model, interior, writer, watch.comm):
            rules = writer.tip_rules if writer else None
            estimator = make_estimator(model, mesh, last, watch.comm, kept, signals, rules)
        steps = chain(_pour_out(begun), steps)
        last = store_steps(steps, model.output_every, interior, writer, watch, estimator, watch.comm) or last
    except ConvergenceError:
        watch.check()  # a law that failed has answered with no strength
        raise
    estimator.destroy()
    for note in estimator.list_notes() if writer else ():
        watch.note(note)
    return _conclude(writer, model, mesh, estimator, watch, one, last)


@contextmanager
def _rescue(
    begun: list[Step], model: Model, interior: InteriorField | None, writer: ResultWriter | None, comm: Comm
) -> Iterator[None]:
    """Where the block ends otherwise than well, the step that is there is stored first, if one rank alone can do that.
    """
    try:
        yield
    except BaseException:
        if begun and comm.size == 1:
            with suppress(Exception):  # what ended the run must be what the user hears of
                store_without_errors(_pour_out(begun), model.output_every, interior, writer, comm)
        raise


def _pour_out(begun: list[Step]) -> Iterator[Step]:
    """Steps that are kept nowhere else once they are taken."""
    while begun:
        yield begun.pop(0)


def _find_ends(comm: Comm, model: Model, mesh: Mesh, contact: ContactState) -> tuple[ContactEnd, ...]:
    """Found by the first rank for all, as they are rounded."""
    return do_on_first(comm, PbemError, lambda: find_contact_ends(model, mesh, contact))


def _conclude(
    writer: ResultWriter | None, model: Model, mesh: Mesh, estimator: Estimator, watch: Watch, one: Pass,
    last: Step | None,
) -> Decision:
    """What follows from the errors; the file is finished, or another pass is to take its place.

    Raises ConvergenceError ("accuracy") when passes or unknowns run out.
    """
    with clock.piece("estimate"):
        decision: Decision = do_on_first(
            watch.comm, PbemError,
            lambda: decide(
                model, mesh, expect_writer(writer).relative_errors, estimator, one,
                None if last is None else last.contact))
    for note in decision.notes:
        watch.note(note)
    if decision.failure:
        raise ConvergenceError("accuracy", decision.failure)
    with clock.piece("writing"):
        do_on_first(watch.comm, PbemError, lambda: _end_pass(expect_writer(writer), decision))
    return decision


def _end_pass(writer: ResultWriter, decision: Decision) -> None:
    """What is not accurate yet is not finished."""
    if decision.marked is None:
        writer.finish(may_follow=bool(decision.ends))
    else:
        writer.fail("accuracy", "a finer mesh was to follow", "stopped")
