"""One model's run in this process (on all ranks of it), and the record of how it went."""

from __future__ import annotations

import hashlib
import re
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

import pbem
from pbem.case.build import read_checked_model
from pbem.errors import CaseError, ConvergenceError, PbemError
from pbem.model.sliver import Tie
from pbem.parallel import world
from pbem.results.reader import Results
from pbem.solve.problem.step import Iteration, SilentReporter, Step

from .conditions import is_finite, measure_balance, measure_contact, measure_energy, measure_scales
from .equilibrium import can_balance, find_unloaded
from .history import count_stages
from .kinds import Sample, draw_sample, vary_units
from .looseness import measure_play

# Reasons that tell something true of a model; all others (mode cycle, iteration limit, ...) are failures.
NAMED_REASONS = ("free motion", "limit load", "no admissible modes", "refused")

MOST_ITERATIONS = 25
# Of the largest traction or jump: what equations and laws are solved to, and rounding.
CONTACT = 1e-7
# Of the forces on a body: the discretisation's error.
BALANCE = 2e-2
ENERGY = 1e-6
# Rigid bodies bear more than elastic ones, which part and slip where they are loaded most.
NEAR = 1.25
# Between the same model in other units, places and on other ranks, of the largest value.
EQUAL = 1e-5


@dataclass
class Record:
    """How a run went. iterations: of each step, its tries that failed not counted; halved: how often a step was;
    wasted: iterations of tries that failed. marks: hashes of the modes of each step; values: numbers without units that
    are the same in all. faults: what is wrong with it, in words; verdict: on an early end, from rigid bodies.
    """

    seed: int
    kind: str
    variant: int
    ranks: int
    status: str = ""
    detail: str = ""
    iterations: list[int] = field(default_factory=list)
    halved: int = 0
    wasted: int = 0
    pairs: int = 0
    seconds: float = 0.0
    contact: dict[str, float] = field(default_factory=dict)
    balance: float = 0.0
    energy: float = 0.0
    marks: list[str] = field(default_factory=list)
    values: list[float] = field(default_factory=list)
    verdict: str = ""
    faults: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def as_dict(self) -> dict[str, Any]:
        """For a line of JSON."""
        return asdict(self)


class Watch(SilentReporter):
    """Counts the iterations of every try of a step, and remembers where it is."""

    def __init__(self) -> None:
        self.count = self.halved = self.wasted = 0
        self.iterations: list[int] = []
        self.notes: list[str] = []
        self.target = (0, 0.0)

    def note(self, text: str) -> None:
        """Remember a note."""
        self.notes.append(text)

    def start_step(self, stage: int, reached: float, target: float) -> None:
        """A try begins."""
        self.count, self.target = 0, (stage, target)

    def iterate(self, iteration: Iteration) -> None:
        """Count."""
        self.count += 1

    def accept(self, step: Step) -> None:
        """The try has converged."""
        self.iterations.append(self.count)

    def reject(self, reason: str, detail: str) -> None:
        """The try has failed."""
        self.halved += 1
        self.wasted += self.count


def run_sample(seed: int, variant: int, folder: Path, kinds: tuple[str, ...]) -> Record:
    """Run the model of a seed in its own units (variant 0) or others; every rank calls this and gets a record.

    folder: for the case and result file, which are removed.
    """
    sample = draw_sample(seed, kinds)
    units = vary_units(sample, variant) if variant else sample.units
    text = sample.text(units)
    stem = folder / f"{sample.kind}_{seed}_{variant}"
    case, output = stem.with_suffix(".toml"), stem.with_suffix(".h5")
    if world.rank == 0:
        case.write_text(text)
    world.Barrier()
    record, watch = Record(seed, sample.kind, variant, world.size), Watch()
    begin = time.perf_counter()
    try:
        results = pbem.run(case, output, reporter=watch)
        record.status = "settled"
    except ConvergenceError as error:
        results, record.status, record.detail = None, error.reason, error.detail
        watch.wasted += watch.count
    except CaseError as error:
        results, record.detail = None, "; ".join(map(str, error.faults))
        is_true = re.search(r"free rigid motion|loads do not balance", record.detail)
        record.status = "refused" if is_true else "CaseError"
    record.seconds = time.perf_counter() - begin
    record.iterations, record.halved, record.wasted, record.notes = (
        watch.iterations, watch.halved, watch.wasted, watch.notes
    )  # fmt: skip
    if world.rank == 0:
        if results is not None:
            judge(record, results, sample.draft.tables(units), read_checked_model(case).ties)
        elif world.size == 1:
            record.verdict = judge_end(sample, record.status, watch.target, stem.with_suffix(".open.toml"))
            if record.status not in NAMED_REASONS or (record.status, record.verdict) == ("free motion", "squeezed"):
                record.faults.append(f"ended: {record.status} ({record.verdict})")
        for path in (case, output):
            path.unlink(missing_ok=True)
    world.Barrier()
    return record


def judge(record: Record, results: Results, tables: dict[str, Any], ties: Sequence[Tie]) -> None:
    """Complete the record of a settled run with what its results obey; ties: see measure_contact."""
    if not is_finite(results):
        record.faults.append("not finite")
        return
    scales = measure_scales(results, tables)
    record.pairs = results.pairs.count
    record.contact = measure_contact(results, tables, scales, ties)
    record.balance = measure_balance(results, tables)
    record.energy = measure_energy(results, tables)
    record.marks, record.values = describe(results)
    record.faults += [f"{rule} {value:.1e}" for rule, value in record.contact.items() if not value <= CONTACT]
    if not record.balance <= BALANCE:
        record.faults.append(f"out of balance {record.balance:.1e}")
    if not record.energy <= ENERGY:
        record.faults.append(f"energy {record.energy:.1e}")
    if max(record.iterations, default=0) > MOST_ITERATIONS:
        record.faults.append(f"{max(record.iterations)} iterations")


def judge_end(sample: Sample, status: str, target: tuple[int, float], case: Path) -> str:
    """What can be said of an early end without the solver of contact.

    "true": taken to be rigid, the bodies have no balance; "weakened": none once the contacts have lost what they can
    lose; "near": none at loads a little larger; "loose": a body can lie between its neighbours without touching them;
    "squeezed": no body without loads can; "unloaded": there are some, of which nothing is known; else "unproved".
    """
    tables = sample.draft.tables()
    moments = [(stage, 1.0) for stage in range(count_stages(tables))] if status == "refused" else [target]
    if not all(can_balance(tables, *moment) for moment in moments):
        return "true"
    if not all(can_balance(tables, *moment, weakened=True) for moment in moments):
        return "weakened"
    if not all(can_balance(tables, stage, NEAR * factor) for stage, factor in moments):
        return "near"
    bodies = find_unloaded(tables, *moments[-1])
    if not bodies:
        return "unproved"
    try:
        play = measure_play(sample.draft, bodies, *moments[-1], case)
    except PbemError:
        return "unloaded"
    return "loose" if max(play.values()) > 0 else "squeezed"


def describe(results: Results) -> tuple[list[str], list[float]]:
    """Marks of the modes of each step; largest jumps and tractions of each step, over those of the run."""
    contact = [results.contact[name] for name in results.pairs.names]
    if not contact:
        return [], []
    mode, opening, slip, p_n, p_s = (
        np.concatenate([getattr(each, key) for each in contact], axis=1)
        for key in ("mode", "opening", "slip", "traction_n", "traction_s")
    )
    marks = [hashlib.sha1(row.astype("i1").tobytes()).hexdigest()[:10] for row in mode]
    values: list[float] = []
    for group in ((opening, slip), (p_n, p_s)):
        largest = max(float(np.abs(each).max()) for each in group) or 1.0
        values += [float(value) for each in group for value in np.abs(each).max(axis=1) / largest]
        values += [float(value) for each in group for value in np.abs(each).mean(axis=1) / largest]
    return marks, values


def compare(first: Record, other: Record) -> str:
    """How a run differs from that of the same model in other units or on other ranks; empty if it does not."""
    if first.status != other.status:
        return f"{first.status} or {other.status}"
    if first.status != "settled":
        return ""
    if first.iterations != other.iterations:
        return f"iterations {first.iterations} or {other.iterations}"
    if first.marks != other.marks:
        return "modes differ"
    difference = max((abs(a - b) for a, b in zip(first.values, other.values, strict=True)), default=0.0)
    return f"values differ by {difference:.1e}" if difference > EQUAL else ""
