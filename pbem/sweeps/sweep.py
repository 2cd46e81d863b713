"""Parameter sweeps: a case run with all combinations of some values; common parts are computed once."""

from __future__ import annotations

import hashlib
import os
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pbem.case.build import Source, find_file, make_checked_model
from pbem.case.case import Case
from pbem.case.changed import Label, label_key
from pbem.case.overrides import write_overrides
from pbem.case.writer import write_tables
from pbem.clock import clock
from pbem.description import case as description
from pbem.driver import impose_operator, run
from pbem.errors import CaseError, ConvergenceError, Fault, LawError, PbemError, ResultFileError, StopError
from pbem.mesh.generate import generate_mesh
from pbem.mesh.mesh import Mesh
from pbem.model.model import Model, Operator, list_wet
from pbem.model.recall import Recall
from pbem.parallel import Comm, StopSignals, abort_if_unexpected, broadcast, check_communicator, do_on_first
from pbem.solve.launch.arguments import check_arguments
from pbem.solve.launch.start import check_shares, check_start
from pbem.solve.launch.watch import Watch
from pbem.solve.petsc.log import petsc_log
from pbem.solve.petsc.options import check_options
from pbem.solve.petsc.session import petsc_options
from pbem.solve.problem.step import SilentReporter
from pbem.solve.steps.march import march
from pbem.solve.steps.prediction import Place
from pbem.solve.system.kept import KeptProblems
from pbem.sweeps.files import name_results
from pbem.sweeps.outcome import Names, Outcome, list_quantity_names
from pbem.sweeps.quantities import Quantity, choose_quantities, evaluate_all, read_quantities
from pbem.sweeps.sharing import Share, choose_share, sort_cases
from pbem.sweeps.table import Row, SweepTable, TableFile
from pbem.sweeps.values import check_combinations, check_values, combine, find_place, write_cell
from pbem.wording import show

# Models that were made to try the values and are kept until they are computed.
MOST_CHECKED = 32
# Told of every case: how many there are and were before, its values and its row.
Listener = Callable[[int, int, Mapping[str, Any], Row], None]


@dataclass(frozen=True)
class Plan:
    """What all ranks know of a sweep. todo: the cases that are to be computed, in that order."""

    names: Names
    quantities: tuple[str, ...]
    todo: tuple[dict[str, Any], ...]
    share: Share


@dataclass(frozen=True)
class Setting:
    """What holds for all cases of a sweep. label: how messages name what was set. checked: models that are there;
    recall: what was found of the last case."""

    case: Source
    fixed: Mapping[str, Any]
    operator: Operator | None
    petsc: Mapping[str, str]
    keep: Path | None
    neighbours: bool
    label: Label
    checked: dict[tuple[str, ...], Model] = field(default_factory=dict)
    recall: Recall = field(default_factory=Recall)

    @property
    def name(self) -> str:
        """What messages call the case."""
        path = find_file(self.case)
        return description.UNNAMED if path is None else str(path)


def sweep(
    case: Source,
    values: Mapping[str, Sequence[Any]],
    quantities: Sequence[str] | None = None,
    *,
    out: str | os.PathLike[str] | None = None,
    keep: str | os.PathLike[str] | None = None,
    set: Mapping[str, Any] | None = None,
    petsc: Mapping[str, str] | None = None,
    operator: Operator | None = None,
    force: bool = False,
    neighbours: bool = True,
    comm: Comm | None = None,
    listener: Listener | None = None,
    label: Label = label_key,
    option: str = "",
) -> SweepTable:
    """Run a case with all combinations of values, and return a table with one row for each.

    case: as in `pbem.run`. values: for each key, as in `Case.replace`, the values it takes; the last key varies
    fastest. quantities: taken from the last step of each case, see `pbem help sweeps`; by default reactions, the
    largest slips and openings, and stress-intensity factors. out: a file for the table (CSV); an existing table is
    continued, and its rows are not computed again. keep: a folder for the result files of the cases; rows whose file is
    missing are computed again. Without keep no result files are written, and errors are not estimated. set: values that
    are the same in all cases. petsc, operator: as in `pbem.run`. force: replace an existing table. neighbours: start
    the search for the statuses of a case from those of its neighbours, if the laws have no memory; a case with more
    than one equilibrium, which is possible with high friction, may then reach another one than in a single run. comm:
    the ranks that share the cases, or compute each case together, whichever is faster; all of them have to call this
    and receive the table. listener: called with each case, on the first rank. label, option: names of values and
    quantities in messages.

    A case that does not converge gives a row with the status "failed" and the reason, an invalid combination of values
    a row with the status "refused"; neither has quantities except those of steps. The reason of a finished row has the
    notes on its steps.

    Raises CaseError with all faults of the case, of single values and of the quantities; ResultFileError (the table
    belongs to another sweep, or a folder cannot be written); LaunchError; StorageError; StopError or KeyboardInterrupt,
    after which the sweep can be continued.
    """
    comm = check_communicator(comm)
    check_arguments(operator, petsc, {"force": force, "neighbours": neighbours}, listener)
    folder = None if keep is None else Path(keep)
    setting = Setting(case, {} if set is None else set, operator, petsc or {}, folder, neighbours, label)
    file: list[TableFile] = []
    try:
        with abort_if_unexpected(comm, PbemError), petsc_log(setting.name, setting.petsc):
            with clock.piece("start"):
                check_start(comm)
            with clock.piece("reading"):
                several = do_on_first(comm, PbemError, lambda: _check(values, quantities, setting.fixed))
                plan = do_on_first(comm, PbemError, lambda: _make_plan(
                    setting, several, quantities, out, force, comm, file, option))
            columns = read_quantities(plan.quantities, plan.names)
            rows = _compute_all(setting, plan, columns, comm, _Keeper(several, file, listener, len(plan.todo)))
            return _make_table(several, [column.title for column in columns], rows)
    except StopError as error:
        if error.reason == "SIGINT":  # as without MPI, so that it ends whatever called this
            raise KeyboardInterrupt from error
        raise
    finally:
        for each in file:
            each.close()


def _check(values: Mapping[str, Any], quantities: Any, fixed: Any) -> dict[str, list[Any]]:
    several = check_values(values)
    check_combinations(several)
    if not isinstance(fixed, Mapping):
        raise CaseError("the sweep", (Fault("set", show(fixed), "a dictionary: values by keys"),))
    if quantities is not None and (isinstance(quantities, str) or not isinstance(quantities, Iterable)):
        found = "a text" if isinstance(quantities, str) else show(quantities)
        raise CaseError("the sweep", (Fault("quantities", found, "a list of texts"),))
    return several


def _cells(values: Mapping[str, Any]) -> tuple[str, ...]:
    return tuple(write_cell(each) for each in values.values())


def _make_model(setting: Setting, values: Mapping[str, Any]) -> Model:
    model = setting.checked.pop(_cells(values), None)
    if model is None:
        model = make_checked_model(setting.case, {**setting.fixed, **values}, setting.label, setting.recall)
    return impose_operator(model, setting.name, setting.operator)


def _make_plan(
    setting: Setting, several: dict[str, list[Any]], quantities: Sequence[str] | None,
    out: str | os.PathLike[str] | None, force: bool, comm: Comm, file: list[TableFile], option: str,
) -> Plan:
    """Check the case with every value, and find out what is to be computed; on the first rank, which opens the table.
    """
    cases = list(combine(several))
    first = _check_values_alone(setting, several, cases[0])
    check_options(setting.name, first.solver.petsc, setting.petsc)
    mesh = _mesh(setting, first)
    names = list_quantity_names(first, mesh)
    wanted = tuple(choose_quantities(first, names) if quantities is None else quantities)
    columns = read_quantities(wanted, names, option)
    overlap = [each.title for each in columns if each.title in several]
    if overlap:
        raise CaseError("the quantities", tuple(Fault(each, "a key that is set", "a quantity") for each in overlap))
    if setting.keep is not None:
        _make_folder(setting.keep)
    if out is not None:
        inputs = [path for path in (find_file(setting.case), *map(Path, first.law_texts)) if path is not None]
        if any(Path(out).exists() and path.exists() and path.samefile(out) for path in inputs):
            raise ResultFileError(str(out), "is a file that the case is read from; name another file")
        file.append(TableFile(out, list(several), [each.title for each in columns], _mark(setting, first), force))
    done = file[0].done if file else {}
    todo = sort_cases([each for each in cases if _is_to_be_computed(setting, each, done.get(_cells(each)))], several)
    return Plan(names, wanted, tuple(todo), choose_share(first, mesh, comm, len(todo), several))


def _is_to_be_computed(setting: Setting, values: Mapping[str, Any], row: Row | None) -> bool:
    """Whether a case has no row, or lacks the result file that is asked for; what makes no case never has one."""
    if row is None or setting.keep is None or row.status == "refused":
        return row is None
    return not (setting.keep / name_results(values)).exists()


def _check_values_alone(
    setting: Setting, several: Mapping[str, Sequence[Any]], first: Mapping[str, Any]
) -> Model:
    """The model of the first case, after every value was tried beside the first of all others.

    Raises CaseError with what is wrong with any.
    """
    faults: dict[Fault, None] = {}
    found: Model | None = None
    source = ""
    tried = [dict(first), *({**first, key: each} for key, values in several.items() for each in values[1:])]
    for values in tried:
        try:
            model = make_checked_model(setting.case, {**setting.fixed, **values}, setting.label, setting.recall)
        except CaseError as error:
            faults |= dict.fromkeys(error.faults)
            source = error.source
            continue
        found = found or model
        if len(setting.checked) < MOST_CHECKED:
            setting.checked[_cells(values)] = model
    if faults or found is None:
        raise CaseError(source, tuple(faults))
    return impose_operator(found, setting.name, setting.operator)


def _mark(setting: Setting, model: Model) -> str:
    """A short text that is another one for another case, or other settings."""
    case = setting.case
    if isinstance(case, description.Case):
        tables = case.given
    elif isinstance(case, Mapping):
        tables = Case(**case).given
    else:
        tables = Case.read(case).given
    told = [write_tables(tables), write_overrides(setting.fixed), setting.operator or "",
            *(f"{name}={value}" for name, value in sorted(setting.petsc.items())), *model.law_texts.values()]
    return hashlib.sha256("\0".join(told).encode("utf-8", "surrogatepass")).hexdigest()[:12]


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise ResultFileError(str(folder), f"is no folder for result files ({error.strerror})") from error


@dataclass
class _Keeper:
    """Takes the rows as they come, on the first rank."""

    several: Mapping[str, Sequence[Any]]
    file: list[TableFile]
    listener: Listener | None
    count: int
    rows: dict[tuple[str, ...], Row] = field(default_factory=dict)
    new: int = 0

    def add(self, values: Mapping[str, Any], row: Row) -> None:
        """A case was computed."""
        self.rows[row.cells] = row
        self.new += 1
        with clock.piece("writing"):
            for file in self.file:
                file.add(row)
        if self.listener is not None:
            self.listener(self.new, self.count, values, row)

    def finish(self) -> list[Row]:
        """The rows of all combinations in order, those there were before among them."""
        order = [_cells(each) for each in combine(self.several)]
        for file in self.file:
            file.sort(order)
            self.rows = {**file.done, **self.rows}
        return [self.rows[cells] for cells in order]


def _compute_all(
    setting: Setting, plan: Plan, columns: Sequence[Quantity], comm: Comm, keeper: _Keeper
) -> list[Row]:
    """All rows, on every rank."""
    with plan.share.open(comm) as group, _keep(group.comm) as kept, StopSignals() as signals:
        signals.at_once = group.comm.size == 1

        def compute(values: dict[str, Any]) -> Row:
            return compute_case(setting, values, columns, kept, signals, find_place(values, keeper.several))

        group.share_out(plan.todo, compute, keeper.add)
    return broadcast(comm, do_on_first(comm, PbemError, keeper.finish, share=False))  # type: ignore[no-any-return]


@contextmanager
def _keep(comm: Comm) -> Iterator[KeptProblems]:
    kept = KeptProblems(comm)
    try:
        yield kept
    except PbemError:
        kept.destroy()
        raise
    kept.destroy()


def compute_case(
    setting: Setting, values: dict[str, Any], columns: Sequence[Quantity], kept: KeptProblems, signals: StopSignals,
    place: Place,
) -> Row:
    """The row of one case; all ranks of `kept.comm` call this together, and the first knows the quantities.

    place: among the other cases.
    """
    begun = time.perf_counter()
    comm, status, reason = kept.comm, "finished", ""
    outcome = Outcome()
    try:
        with clock.piece("reading"):
            model = do_on_first(comm, PbemError, lambda: _make_model(setting, values))
        # Ends of contact are graded where that is asked for: cases share operators, and a mesh, but for that.
        asked = model.analysis.accuracy is not None or model.analysis.grade_contact_ends is True
        if setting.keep is not None or asked:
            _run_with_file(setting, values, outcome, kept)
        else:
            with clock.piece("reading"):
                mesh = _mesh(setting, model)
            _solve(model, mesh, setting, outcome, columns, kept, signals, place)
    except CaseError as error:
        status, reason = "refused", "; ".join(str(fault) for fault in error.faults)
    except (ConvergenceError, LawError) as error:
        status, reason = "failed", str(error)
        kept.forget_factors()
    with clock.piece("evaluation"):
        known = comm.rank == 0 and outcome.step is not None
        found, absent = evaluate_all(columns, outcome, status == "finished", known)
    notes = [each.rstrip(".") for each in outcome.notes]
    reason = "; ".join([*([reason] if reason else []), *absent, *notes])
    return Row(_cells(values), tuple(found), status, outcome.iterations, time.perf_counter() - begun, reason)


def _mesh(setting: Setting, model: Model) -> Mesh:
    """The mesh of the last case if this one has the same: neither laws nor conditions are part of it, but for which
    contacts are ever under fluid."""
    interfaces = [(each.name, each.first, each.second) for each in model.interfaces.values()]
    contacts = [(each.name, each.first, each.second) for each in model.contacts.values()]
    given = (model.curves, model.regions, interfaces, contacts, model.crack_tips, model.analysis, model.size,
             list_wet(model))
    return setting.recall.find("mesh", given, lambda: generate_mesh(model))


def _solve(
    model: Model, mesh: Mesh, setting: Setting, outcome: Outcome, columns: Sequence[Quantity], kept: KeptProblems,
    signals: StopSignals, place: Place,
) -> None:
    """March through the history, without a result file."""
    comm = kept.comm
    check_shares(model, mesh, comm.size)
    if comm.rank == 0:
        outcome.expect(model, mesh)
    watch = Watch(comm, outcome if comm.rank == 0 else SilentReporter(), signals)
    with petsc_options({**model.solver.petsc, **setting.petsc}):
        with clock.piece("assembly"):
            problem = kept.assemble(model, mesh)
        watch.look_after(problem.laws)
        watch.check()
        try:
            with clock.piece("steps"):
                tangent = kept.take_tangent(problem)
                guess = kept.guess_modes(problem, place) if setting.neighbours else None
            found = march(problem, watch, None, tangent, guess, any(each.of_faces for each in columns))
            steps = clock.each("steps", found)
            kept.remember(problem, place, {(step.stage, step.factor): step.contact for step in steps})
        except ConvergenceError:
            watch.check()  # a law that failed has answered with no strength
            raise


def _run_with_file(setting: Setting, values: dict[str, Any], outcome: Outcome, kept: KeptProblems) -> None:
    """A whole run, with its result file, and with estimated errors."""
    def compute(target: Path) -> None:
        run(setting.case, target, force=True, petsc=setting.petsc, operator=setting.operator, reporter=outcome,
            set={**setting.fixed, **values}, comm=kept.comm, label=setting.label, kept=kept)

    if setting.keep is not None:
        compute(setting.keep / name_results(values))
        return
    with tempfile.TemporaryDirectory() as folder:
        compute(Path(do_on_first(kept.comm, PbemError, lambda: folder)) / "case.h5")


def _make_table(several: Mapping[str, Sequence[Any]], titles: Sequence[str], rows: Sequence[Row]) -> SweepTable:
    filled = [
        {**values, **dict(zip(titles, row.quantities, strict=True)), "status": row.status,
         "iterations": row.iterations, "seconds": row.seconds, "reason": row.reason}
        for values, row in zip(combine(several), rows, strict=True)
    ]
    return SweepTable(several, titles, filled)
