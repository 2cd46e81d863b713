"""Writes the result file: the header at once, then one more entry along the first axis per stored step."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType, TracebackType

import h5py
import numpy as np

from pbem.arrays import Complex, Integer, Real
from pbem.contact.custom import find_fault
from pbem.errors import ConvergenceError, LawError, ResultFileError, StopError, StorageError
from pbem.mesh.mesh import Mesh, list_faces, sort_pairs
from pbem.model.model import Model
from pbem.results.absent import Absence
from pbem.results.balance import append_balance
from pbem.results.coverage import Coverage
from pbem.results.energy import Energy, EnergyBalance
from pbem.results.former import read_former, write_former
from pbem.results.hoop_stress import HoopStress
from pbem.results.layout import (
    ENERGIES,
    ITERATION,
    MAY_FOLLOW,
    SHOWN,
    STEP_DATASETS,
    count_steps,
    join_pairs,
    list_pair_datasets,
    name_stages,
    to_columns,
    write_attributes,
    write_header,
)
from pbem.results.linearity import append_linearity
from pbem.results.notes import append_notes
from pbem.results.opening import refuse_damage
from pbem.results.output import check_output_path
from pbem.results.resume import check_same_case, read_last_energy, read_last_step, recall_coverage, truncate
from pbem.results.rigid import append_rigid
from pbem.results.runaway import describe_runaway
from pbem.results.store import Store, create_store, remove_stale_parts
from pbem.results.tips import collect_tip_rules
from pbem.results.unfinished import drop_unfinished, read_unfinished, write_unfinished
from pbem.solve.problem.step import Former, InteriorValues, Iteration, Step, Unfinished

# What ends a run though nothing is wrong with it.
STOPPED = (MemoryError, StorageError, BrokenPipeError)


@dataclass(frozen=True)
class Reached:
    """A step, the one before it, and what is stored with it: energies, and estimated errors by name (see `append`)."""

    step: Step
    before: Step | None
    energy: Energy
    estimates: Mapping[str, Real]


class ResultWriter:
    """Context manager that writes results.h5 as the run goes on; for one rank only.

    The header is written under a temporary name and moved to `path` when complete, so that a file of that name always
    can be read. Every `model.output_every`-th step is stored, and the last of each stage; when the run ends early, the
    last one reached as well. Steps are on the disk when `append` returns; whatever ends the process before, the file
    holds the steps before. Nobody else can write the file meanwhile.

    Leaving the context sets the status to "finished"; leaving it by an exception, to "failed" or "stopped" (by the
    user, the system, or for want of memory or room) with the attributes `failure` (text) and `failure_reason` (short
    name).

    interior_region (q,): index of the region of every interior point (-1 outside of all), from `InteriorField`; needed
    if the model has such points.

    last_step: the last stored step of a resumed file (its `iterations` are empty), None of a new one. unfinished: the
    step after it in which the run was stopped, or None. former: the step before it, if it was of the same stage.
    tip_rules: how the values at the tips follow from a step. notes: what the file tells of the run.
    """

    def __init__(
        self, path: str | os.PathLike[str], model: Model, mesh: Mesh, ranks: int, petsc_version: str,
        petsc_options: Sequence[str] = (), interior_region: Integer | None = None, *, force: bool = False,
    ) -> None:
        """force: the file takes the place of results that are there.

        Raises ResultFileError if the file cannot be written there, is there already, or another run is writing it.
        """
        target = check_output_path(path, force=force)

        def fill(file: h5py.File) -> None:
            regions = np.full(len(model.interior_points), -1) if interior_region is None else interior_region
            write_header(file, model, mesh, regions)
            write_attributes(file, model, ranks, petsc_version, petsc_options)

        try:
            storage = create_store(target, force, fill)
        except OSError as error:
            raise ResultFileError(str(path), f"cannot be written ({error})") from error
        try:
            self._start(target, storage, model, mesh, None, None)
        except BaseException:
            storage.drop()
            raise

    @classmethod
    def resume(
        cls, path: str | os.PathLike[str], model: Model, mesh: Mesh, ranks: int, petsc_version: str,
        petsc_options: Sequence[str] = (), interior_region: Integer | None = None,
    ) -> ResultWriter:
        """A writer that goes on after the last step stored in an existing file of the same case.

        Raises ResultFileError if there is no such file, it cannot be read, was damaged, holds another case or mesh, or
        another run is writing it.
        """
        target = check_output_path(path, resume=True)
        remove_stale_parts(target)
        with refuse_damage(target):
            storage = Store(target)
        try:
            with refuse_damage(target):
                file = storage.file
                check_same_case(str(path), file, model, mesh)
                last_step = read_last_step(file, model, mesh)
                reached = None if last_step is None else read_last_energy(file)
                truncate(file, 0 if last_step is None else last_step.number)
                write_attributes(file, model, ranks, petsc_version, petsc_options)
                name_stages(file["steps/stage"].id, model)  # some may have been added
            writer = cls.__new__(cls)
            writer._start(target, storage, model, mesh, last_step, reached)
            with refuse_damage(target):
                writer.unfinished = read_unfinished(file, writer._pairs)
                writer.former = read_former(file, writer._pairs)
                recall_coverage(file, writer._pairs, writer._coverage)
            storage.commit()
        except OSError as error:
            storage.drop()
            raise ResultFileError(str(path), f"cannot be written ({error})") from error
        except BaseException:
            storage.drop()
            raise
        return writer

    def _start(
        self, path: Path, storage: Store, model: Model, mesh: Mesh, last_step: Step | None, reached: Energy | None
    ) -> None:
        self.path = path
        self._model, self._mesh = model, mesh
        self.last_step = last_step
        self.unfinished: Unfinished | None = None
        self.former: Former | None = None
        self._latest = last_step
        self._storage = storage
        self._every = max(1, model.output_every)
        self._pairs = join_pairs(sort_pairs(mesh))
        self.tip_rules = collect_tip_rules(model, mesh)
        self._balance, self._coverage = EnergyBalance(model, mesh, last_step, reached), Coverage(model, mesh)
        points = self._file["interior/region"][...] if "interior" in self._file else np.zeros(0, dtype=np.int64)
        self._hoop_stress = HoopStress(model, mesh)
        self._absence = Absence(model, mesh, points)
        self._last_stored = 0 if last_step is None else last_step.number
        self._pending: Reached | None = None  # is to be stored if the run ends with it
        self._tried: Reached | None = None  # is being appended
        self.appended = 0  # steps that are in the file for good
        self.notes: Iterable[str] = ()  # read whenever something is brought to the disk
        self._noted: set[str] = set()  # those that the open file has

    @property
    def _file(self) -> h5py.File:
        return self._storage.file

    def append(self, step: Step, estimates: Mapping[str, Real] | None = None) -> tuple[str, ...]:
        """Store the step if it is its turn, and its iterations in any case; all of it is on the disk, or nothing.

        estimates: its estimated errors, of `pbem.results.estimates.to_rows`; NaN is stored without.
        Gives what the user should know.

        Raises StorageError if the disk has no room for it, LawError if a custom law fails; the file then holds the
        steps before.
        """
        drop_unfinished(self._file)
        before, self._latest = self._latest, step
        rows = [_iteration_row(step.number, iteration) for iteration in step.iterations]
        self._storage.rows.extend("convergence", np.array(rows, dtype=ITERATION))
        self._tried = reached = Reached(step, before, self._balance.add(step), estimates or {})
        fault = find_fault(group.law for group in self._balance.laws.strengths)
        if fault:
            raise LawError(fault)
        if step.is_due(self._every):
            self._store(reached)
        self._commit(f"step {step.number}")
        self._pending, self._tried = None if step.is_due(self._every) else reached, None
        self.appended += 1
        # What has to move before it touches is noted with the model.
        runaway = None if self._model.closing and step.number == 1 else self._balance.runaway
        notes = [] if runaway is None else [describe_runaway(step, runaway)]
        return (*notes, *self._coverage.follow(step))

    def _commit(self, what: str) -> None:
        try:
            self._append_notes()
            self._storage.commit()
        except OSError as error:
            raise StorageError(str(self.path), f"no room for {what} ({error.strerror or error})") from error

    def _append_notes(self) -> bool:
        """Keep the notes that are new; whether there were any."""
        new = [each for each in self.notes if each not in self._noted]
        self._noted.update(new)
        return bool(new) and append_notes(self._file, new)

    def _roll_back(self) -> None:
        """Forget what was written since the last commit."""
        self._storage.roll_back()
        self._noted.clear()
        self._last_stored = self._find_numbers()[1]

    def _find_last(self) -> Reached | None:
        """The step that the file ends with, if it has its iterations alone: after a commit that failed that is the
        step before, or the step itself where it failed when all was on the disk."""
        last, stored = self._find_numbers()
        return next((each for each in (self._pending, self._tried) if each and stored < each.step.number == last), None)

    def _find_numbers(self) -> list[int]:
        """Numbers of the last step that has its iterations in the file, and of the last one stored; 0 for none."""
        return [int(each[-1]) if len(each) else 0
                for each in (self._file["convergence"]["step"], self._file["steps/number"])]

    def complete(self, interior: InteriorValues) -> None:
        """The interior points of the step that was appended last, if it was not its turn to be stored."""
        if self._pending is not None:
            self._pending = replace(self._pending, step=replace(self._pending.step, interior=interior))

    def _store(self, reached: Reached) -> None:
        file, rows, step = self._file, self._storage.rows, reached.step
        write_former(file, reached.before, step, self._pairs, self._last_stored)
        hoop_stress, reactions = self._hoop_stress.evaluate(step), self._sum_reactions(step.traction)
        tips = self.tip_rules.evaluate_all(step) if self.tip_rules.cracks else {}
        gone = self._absence.list_faces(step.stage)
        if gone is not None:
            hoop_stress = np.where(gone, np.nan, hoop_stress)
            tips = self._absence.blank_tips(step.stage, self.tip_rules.cracks, tips)
            step = self._absence.blank(step)
        rows.append("fields/hoop_stress", hoop_stress)
        if rows.list_names("interior"):
            count = len(self._model.interior_points)
            none = InteriorValues(np.full(count, complex(np.nan, np.nan)), np.full((count, 3), np.nan))
            interior = step.interior or none
            rows.append("interior/displacement", to_columns(interior.displacement))
            rows.append("interior/stress", interior.stress)
        rows.append("fields/displacement", to_columns(step.displacement))
        rows.append("fields/traction", to_columns(step.traction))
        if self._model.conditions or self._model.point_supports:
            unknown = np.full(2, np.nan)
            supports = [step.support_reactions.get(name, unknown) for name in self._model.point_supports]
            of_both = [to_columns(reactions), np.array(supports).reshape(-1, 2)]
            rows.append("all/reactions", np.concatenate(of_both))
        contact = {name: getattr(step.contact, name) for name in SHOWN} | dict(step.contact.internal)
        for quantity in list_pair_datasets(self._model) if len(self._pairs) else ():
            rows.append(f"all/contact/{quantity}", contact[quantity][self._pairs])
        for kind, at_tips in tips.items():
            rows.append(f"all/tips/{kind}", at_tips)
        for name in rows.list_names("estimates"):
            rows.append(f"estimates/{name}", reached.estimates.get(name, np.nan))
        for kind in ENERGIES:
            rows.append(f"energy/{kind}", getattr(reached.energy, kind))
        append_balance(rows, step)
        append_linearity(rows, step)
        if self._model.rigid:
            faces = list_faces(self._mesh)
            append_rigid(rows, self._model, self._mesh.curve_names, faces, step.displacement, step.traction)
        # The steps come last: a reader trusts their number, so that a cut in the middle of this function does no harm.
        values = (step.stage, step.factor, len(step.iterations), step.residual, step.number)
        for quantity, value in zip(STEP_DATASETS, values, strict=True):
            rows.append(f"steps/{quantity}", value)
        self._last_stored = step.number

    def note_missing(self, reason: str) -> None:
        """Say in the file why errors are not estimated."""
        if self._file["estimates"].attrs["missing"] != reason:
            self._file["estimates"].attrs["missing"] = reason
            self._commit("a note")

    def note_pass(self, number: int, first_unknowns: int) -> None:
        """Say in the file which pass of `analysis.accuracy` this is, and the unknowns of the first."""
        self._file["mesh"].attrs.update({"pass": number, "first_unknowns": first_unknowns})
        self._commit("a note")

    @property
    def steps_stored(self) -> int:
        """How many steps the file holds."""
        return count_steps(self._file) if self._storage.is_open else 0

    @property
    def is_within_step(self) -> bool:
        """Whether the last step could not be stored: no other one can follow it."""
        return not self._storage.is_open or self._storage.dirty

    @property
    def relative_errors(self) -> dict[str, Real]:
        """The estimated relative errors (k,) of the steps stored so far, by kind."""
        pending, self._pending = self._pending, None
        if pending is not None:
            self._store(pending)
            self._commit("the last step")
        group = self._file["estimates"]
        return {name.removeprefix("relative_"): group[name][...] for name in group if name.startswith("relative_")}

    def _sum_reactions(self, traction: Complex) -> Complex:
        """Integral (c,) of the traction over every outer curve."""
        mesh, numbers = self._mesh, {name: number for number, name in enumerate(self._model.conditions)}
        condition = np.array([numbers.get(name, -1) for name in mesh.curve_names], dtype=np.int64)[mesh.node_curve]
        outer = np.flatnonzero(condition >= 0)  # never on cracks, which have second faces
        force, of = mesh.weight[outer] * traction[outer], condition[outer]
        count = len(self._model.conditions)
        return np.bincount(of, force.real, count) + 1j * np.bincount(of, force.imag, count)

    def finish(self, may_follow: bool = False) -> None:
        """Set the status to "finished" and close the file. Raises StorageError if the disk has no room.

        may_follow: another pass may take its place, with elements that are graded towards ends of contact.
        """
        if may_follow and self._storage.is_open:
            self._file.attrs[MAY_FOLLOW] = True
        self._close("finished")

    def fail(self, reason: str, detail: str, status: str = "failed") -> None:
        """Set the status, with the reason (a short name) and its detail (sentences); close the file."""
        self._close(status, {"failure": f"{reason}: {detail}" if detail else reason, "failure_reason": reason})

    def _close(self, status: str, reasons: Mapping[str, str] = MappingProxyType({})) -> None:
        if not self._storage.is_open:
            return
        try:
            pending, self._pending = self._pending, None
            if pending is not None:
                self._store(pending)
            if self._append_notes() or pending is not None:
                self._storage.commit()
        except OSError as error:
            self._roll_back()
            if status == "finished":
                self.fail("StorageError", str(error), "stopped")
                raise StorageError(str(self.path), f"no room for the last step ({error.strerror or error})") from error
        for name, value in {**reasons, "status": status}.items():
            self._file.attrs[name] = value
        self._storage.close()

    def __enter__(self) -> ResultWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            self.finish()
            return
        self.abandon(error)

    def abandon(self, error: BaseException, later: str = "") -> Mapping[str, str]:
        """Close the file of a run that an exception has ended; gives the attributes that say so.

        later: where it was ended, if in a pass that is not the one in the file."""
        reasons = _describe_end(error)
        if later:
            reasons = {**reasons, "failure": f"{reasons['failure']}; that was {later}"}
        # What ended the run must be what the user hears of, not that its last words could not be written.
        with suppress(Exception):
            if self._storage.is_open and self._storage.dirty:
                self._roll_back()  # it ended within a step
            if self._storage.is_open and self._tried is not None:
                self._pending = self._find_last()
            if self._storage.is_open and isinstance(error, StopError) and error.unfinished is not None and not later:
                write_unfinished(self._file, error.unfinished, self._pairs)
            self._close(reasons["status"], reasons)
        self._storage.drop()
        return reasons


def _describe_end(error: BaseException) -> Mapping[str, str]:
    """The attributes of a file whose run ended by an exception."""
    if isinstance(error, ConvergenceError | StopError):
        status, reason, detail = "stopped" if isinstance(error, StopError) else "failed", error.reason, error.detail
    elif isinstance(error, KeyboardInterrupt):
        status, reason = "stopped", "interrupted"
        detail = "the run was stopped by the user or the batch system"
    else:
        status, reason, detail = "stopped" if isinstance(error, STOPPED) else "failed", type(error).__name__, str(error)
    return {"failure": f"{reason}: {detail}" if detail else reason, "failure_reason": reason, "status": status}


def _iteration_row(step: int, iteration: Iteration) -> tuple[float, ...]:
    return (step, iteration.number, iteration.residual, iteration.changed,
            iteration.stick, iteration.slip, iteration.open, iteration.seconds, iteration.products)
