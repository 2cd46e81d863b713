"""Writes the result file: the header at once, then one more entry along the first axis per stored step."""

from __future__ import annotations

import os
from collections.abc import Hashable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from types import TracebackType

import h5py
import numpy as np
from numpy.typing import NDArray

from pbem.bem.hoop import evaluate_hoop_stress
from pbem.errors import ConvergenceError, ResultFileError, StorageError
from pbem.mesh.mesh import Mesh, list_faces, sort_pairs
from pbem.model.model import Model
from pbem.results.balance import append_balance
from pbem.results.coverage import describe_sparse_contacts
from pbem.results.energy import Energy, EnergyBalance, describe_runaway
from pbem.results.layout import (
    ENERGIES,
    ITERATION,
    PAIR_DATASETS,
    STEP_DATASETS,
    append_row,
    extend,
    join_pairs,
    open_file,
    to_columns,
    write_attributes,
    write_header,
)
from pbem.results.output import check_output_path
from pbem.results.resume import check_same_case, read_last_energy, read_last_step, truncate
from pbem.results.tips import collect_tip_rules
from pbem.solve.backgrounds import evaluate_backgrounds
from pbem.solve.step import Interior, Iteration, Step

# Bytes that HDF5 may need beyond the data of a step, and to close the file.
ROOM_TO_CLOSE = 2_000_000


class ResultWriter:
    """Context manager that writes results.h5 as the run goes on; for one rank only.

    The header is written under a temporary name and moved to `path` when complete, so that a file of that name always
    can be read. Every `model.output_every`-th step is stored, and the last of each stage; when the run ends early, the
    last one reached as well. Steps are on the disk when `append` returns.

    Leaving the context sets the status to "finished"; leaving it by an exception, to "failed" with the attribute
    `failure` (text) and `failure_reason` (short name).

    interior_region (q,): index of the region of every interior point (-1 outside of all), from `InteriorField`; needed
    if the model has such points.

    last_step: the last stored step of a resumed file (its `iterations` are empty), None of a new one.
    """

    def __init__(
        self, path: str | os.PathLike[str], model: Model, mesh: Mesh, ranks: int, petsc_version: str,
        petsc_options: Sequence[str] = (), interior_region: NDArray[np.int64] | None = None,
    ) -> None:
        """Raises ResultFileError if the file cannot be written there."""
        target = check_output_path(path)
        temporary = target.with_name(f".{target.name}.{os.getpid()}.part")
        try:
            file = open_file(temporary, "w")
            try:
                regions = np.full(len(model.interior_points), -1) if interior_region is None else interior_region
                write_header(file, model, mesh, regions)
                write_attributes(file, model, ranks, petsc_version, petsc_options)
                file.flush()
                temporary.replace(target)
            except BaseException:
                file.close()
                temporary.unlink(missing_ok=True)
                raise
        except OSError as error:
            raise ResultFileError(str(path), f"cannot be written ({error})") from error
        self._start(target, file, model, mesh, None, None)

    @classmethod
    def resume(
        cls, path: str | os.PathLike[str], model: Model, mesh: Mesh, ranks: int, petsc_version: str,
        petsc_options: Sequence[str] = (), interior_region: NDArray[np.int64] | None = None,
    ) -> ResultWriter:
        """A writer that goes on after the last step stored in an existing file of the same case.

        Raises ResultFileError if there is no such file, it cannot be read, or it holds another case or mesh.
        """
        target = check_output_path(path)
        if not target.exists():
            raise ResultFileError(str(path), "there is no such file to resume; run without resuming")
        try:
            file = open_file(target, "r+")
        except OSError as error:
            raise ResultFileError(str(path), f"is not a readable result file ({error})") from error
        try:
            check_same_case(str(path), file, model, mesh)
            last_step = read_last_step(file, mesh)
            reached = None if last_step is None else read_last_energy(file)
            truncate(file, 0 if last_step is None else last_step.number)
            write_attributes(file, model, ranks, petsc_version, petsc_options)
            file.flush()
        except BaseException as error:
            file.close()
            if isinstance(error, KeyError | OSError | ValueError):
                raise ResultFileError(str(path), f"is not a complete result file ({error})") from error
            raise
        writer = cls.__new__(cls)
        writer._start(target, file, model, mesh, last_step, reached)
        return writer

    def _start(
        self, path: Path, file: h5py.File, model: Model, mesh: Mesh, last_step: Step | None, reached: Energy | None
    ) -> None:
        self.path = path
        self._model, self._mesh = model, mesh
        self.last_step = last_step
        self._file = file
        self._every = max(1, model.output_every)
        faces = list_faces(mesh)
        self._weight = faces.weight
        numbers = {name: number for number, name in enumerate(model.conditions)}
        condition_of_curve = np.array([numbers.get(name, -1) for name in mesh.curve_names], dtype=np.int64)
        self._condition = condition_of_curve[faces.curve]
        self._pairs = join_pairs(sort_pairs(mesh))
        self._tip_rules = collect_tip_rules(model, mesh)
        self._balance = EnergyBalance(model, mesh, last_step, reached)
        self._pending: Step | None = None

    def append(
        self, step: Step, estimates: Mapping[str, NDArray[np.float64]] | None = None
    ) -> tuple[str, ...]:
        """Store the step if it is its turn, and its iterations in any case; flush. Gives what the user should know.

        estimates: its estimated errors, of `pbem.results.estimates.to_rows`; NaN is stored without.
        Raises StorageError if the disk has no room for it: HDF5 would leave a file that cannot be read.
        """
        self._require_room(step)
        rows = [_iteration_row(step.number, iteration) for iteration in step.iterations]
        extend(self._file["convergence"], np.array(rows, dtype=ITERATION))
        self._energy = self._balance.add(step)
        self._estimates = estimates or {}
        if step.is_due(self._every):
            self._store(step)
        else:
            self._pending = step
        self._file.flush()
        notes = [] if self._balance.runaway is None else [describe_runaway(step, self._balance.runaway)]
        if step.last_of_stage and step.stage == len(self._model.stages) - 1:
            notes += describe_sparse_contacts(self._model, self._mesh, step.contact.mode)
        return tuple(notes)

    def _require_room(self, step: Step) -> None:
        state = os.statvfs(self.path.parent)
        free = state.f_bavail * state.f_frsize
        fields = (step.displacement, step.traction, *vars(step.contact).values())
        inside = 0 if step.interior is None else step.interior.displacement.nbytes + step.interior.stress.nbytes
        needed = 3 * (sum(field.nbytes for field in fields) + inside) + ROOM_TO_CLOSE
        if free < needed:
            sizes = f"{free / 1e6:.3g} MB are free, {needed / 1e6:.3g} MB may be needed"
            raise StorageError(str(self.path), f"no room for step {step.number}: {sizes}")

    def complete(self, interior: Interior) -> None:
        """The interior points of the step that was appended last, if it was not its turn to be stored."""
        if self._pending is not None:
            self._pending = replace(self._pending, interior=interior)

    def _store(self, step: Step) -> None:
        self._pending = None
        file = self._file
        append_row(file["fields/hoop_stress"], self._evaluate_hoop_stress(step))
        if "interior" in file:
            count = len(self._model.interior_points)
            none = Interior(np.full(count, np.nan + 0j), np.full((count, 3), np.nan))
            interior = step.interior or none
            append_row(file["interior/displacement"], to_columns(interior.displacement))
            append_row(file["interior/stress"], interior.stress)
        append_row(file["fields/displacement"], to_columns(step.displacement))
        append_row(file["fields/traction"], to_columns(step.traction))
        together = file["all"]
        if self._model.conditions:
            append_row(together["reactions"], to_columns(self._sum_reactions(step.traction)))
        for quantity in PAIR_DATASETS if len(self._pairs) else ():
            append_row(together["contact"][quantity], getattr(step.contact, quantity)[self._pairs])
        if self._tip_rules.cracks:
            for kind, at_tips in self._tip_rules.evaluate_all(step).items():
                append_row(together["tips"][kind], at_tips)
        for name, dataset in file["estimates"].items():
            unknown = np.full(dataset.shape[1:], np.nan)
            append_row(dataset, np.asarray(self._estimates.get(name, unknown)))
        for kind in ENERGIES:
            append_row(file["energy"][kind], np.array(getattr(self._energy, kind)))
        append_balance(file, step)
        # The steps come last: a reader trusts their number, so that a cut in the middle of this function does no harm.
        values = (step.stage, step.factor, len(step.iterations), step.residual, step.number)
        for quantity, value in zip(STEP_DATASETS, values, strict=True):
            append_row(file["steps"][quantity], np.array(value))

    def note_missing(self, reason: str) -> None:
        """Say in the file why errors are not estimated."""
        self._file["estimates"].attrs["missing"] = reason

    @property
    def relative_errors(self) -> dict[str, NDArray[np.float64]]:
        """The estimated relative errors (k,) of the steps stored so far, by kind."""
        if self._pending is not None:
            self._store(self._pending)
        group = self._file["estimates"]
        return {name.removeprefix("relative_"): group[name][...] for name in group if name.startswith("relative_")}

    def _evaluate_hoop_stress(self, step: Step) -> NDArray[np.float64]:
        """At the nodes of all faces; regions of the same material are taken as one, as there can be thousands."""
        initial = [balanced for balanced, _ in evaluate_backgrounds(self._model, step.stage, step.factor)]
        kinds: dict[Hashable, int] = {}
        kind_of = [kinds.setdefault((each.material, each.initial), len(kinds)) for each in initial]
        mesh = self._mesh
        if mesh.order > 0:  # else the stretch is told by neighbours of the same region
            mesh = replace(mesh, region=np.array(kind_of)[mesh.region])
            initial = [initial[kind_of.index(number)] for number in range(len(kinds))]
        return evaluate_hoop_stress(mesh, initial, step.displacement, step.traction)

    def _sum_reactions(self, traction: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Integral (c,) of the traction over every outer curve."""
        outer = self._condition >= 0
        force, of = (self._weight * traction)[outer], self._condition[outer]
        count = len(self._model.conditions)
        return np.bincount(of, force.real, count) + 1j * np.bincount(of, force.imag, count)

    def finish(self) -> None:
        """Set the status to "finished" and close the file."""
        self._close("finished")

    def fail(self, reason: str, detail: str) -> None:
        """Set the status to "failed", with the reason (a short name) and its detail (sentences); close the file."""
        if self._file:
            self._file.attrs["failure"] = f"{reason}: {detail}" if detail else reason
            self._file.attrs["failure_reason"] = reason
        self._close("failed")

    def _close(self, status: str) -> None:
        if not self._file:
            return
        if self._pending is not None:
            self._store(self._pending)
        self._file.attrs["status"] = status
        self._file.close()

    def __enter__(self) -> ResultWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            self.finish()
            return
        # What ended the run must be what the user hears of, not that its last words could not be written.
        with suppress(Exception):
            if isinstance(error, ConvergenceError):
                self.fail(error.reason, error.detail)
            elif isinstance(error, KeyboardInterrupt):
                self.fail("interrupted", "the run was stopped by the user or the batch system")
            else:
                self.fail(type(error).__name__, str(error))
        self._file.close()


def _iteration_row(step: int, iteration: Iteration) -> tuple[float, ...]:
    return (step, iteration.number, iteration.residual, iteration.changed,
            iteration.stick, iteration.slip, iteration.open, iteration.seconds)
