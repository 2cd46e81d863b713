"""Reads a result file into frozen objects whose large arrays are loaded on first access."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import h5py
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pbem.arrays import Bool, Real
from pbem.description.generation import GeneratedGroup
from pbem.errors import ResultFileError
from pbem.model.refinement import Fractions
from pbem.results.balance import read_balance
from pbem.results.contents import Balances, Elements, Energies, Errors, Linearities, Nodes, Steps, Tips, Units
from pbem.results.journal import is_being_written
from pbem.results.layout import ENERGIES, read_fractions
from pbem.results.lazy import AllPairs, Interfaces, InteriorPoints
from pbem.results.linearity import read_linearity
from pbem.results.notes import read_notes
from pbem.results.opening import freeze, open_quietly, read_array, read_names, refuse_damage
from pbem.results.outline import find_tips
from pbem.results.rigid import RigidMotion, read_rigid
from pbem.results.sections import (
    read_energy,
    read_errors,
    read_indices,
    read_interior,
    read_reactions,
    read_steps,
    read_tips,
    read_traces,
)
from pbem.results.trial import check_contents

if TYPE_CHECKING:
    from pbem.results.evaluation import Evaluation, Evaluator, Side

STATUSES = ("running", "finished", "failed", "stopped")
ATTEMPTS = 5


@dataclass(frozen=True, repr=False)
class Results:
    """The contents of a result file, with k stored steps and n nodes.

    reactions: for each outer curve (k, 2), integral of the traction; contact: for each interface, crack and contact;
    pairs: the pairs of all of them together; groups: interfaces made by tables [[generate]]; tips: for each crack its
    stress-intensity factors; energy: the energies; balance: of the forces on every region, and linearity: size of
    strains and slips, both None in files of earlier versions; interior: interior points, None if the case has none;
    convergence: one row per Newton iteration with the fields step, iteration, residual, changed, stick, slip, open,
    seconds; rigid: forces on rigid curves and tools, and their motions; notes: what the run told of the model and
    its steps, in order, none in files of earlier versions; overrides: values that were set in addition to the case, one
    line KEY = VALUE each; failure: why the run ended early (status "failed" or "stopped"), empty if it did not, or if
    it was killed.
    """

    path: Path
    title: str
    status: str
    failure: str
    units: Units
    case: str
    overrides: str
    configuration: str
    pbem_version: str
    petsc_version: str
    ranks: int
    nodes: Nodes
    elements: Elements
    steps: Steps
    reactions: Mapping[str, Real]
    contact: Interfaces
    pairs: AllPairs
    groups: tuple[GeneratedGroup, ...]
    tips: Mapping[str, Tips]
    energy: Energies
    balance: Balances | None
    linearity: Linearities | None
    interior: InteriorPoints | None
    convergence: NDArray[Any] = field(repr=False)
    rigid: Mapping[str, RigidMotion] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @cached_property
    def displacement(self) -> Real:
        """(k, n, 2) at the nodes, in units of length; NaN where a stage has removed the region."""
        return self._blank(self._load("fields/displacement"))

    @cached_property
    def traction(self) -> Real:
        """(k, n, 2) at the nodes, in units of stress, global axes; NaN where a stage has removed the region."""
        return self._blank(self._load("fields/traction"))

    @cached_property
    def hoop_stress(self) -> Real:
        """(k, n) normal stress along the boundary, at the nodes, in units of stress."""
        return self._load("fields/hoop_stress")

    @cached_property
    def fractions(self) -> Fractions | None:
        """Ends of the elements on the legs of each curve, if the mesh may have been refined; else None."""
        with open_quietly(self.path) as file:
            return read_fractions(file)

    @cached_property
    def errors(self) -> Errors:
        """Estimated discretisation errors."""
        with open_quietly(self.path) as file:
            return read_errors(file, len(self.steps))

    def displacement_at(self, step: int) -> Real:
        """(n, 2) of one stored step (its index in the file, negative from the end) without loading the others.

        Raises IndexError for a step that is not stored, ValueError for what is no index.
        """
        return self._read_at("fields/displacement", step)

    def traction_at(self, step: int) -> Real:
        """(n, 2) of one stored step, as `displacement_at`."""
        return self._read_at("fields/traction", step)

    def _read_at(self, name: str, step: int) -> Real:
        (number,) = self.choose_steps([step])  # type: ignore[misc]
        with open_quietly(self.path) as file:
            values: Real = file[name][number]
        gone = self.find_gone(step)
        return np.where(gone[self.nodes.region, None], np.nan, values) if gone.any() else values

    def find_gone(self, step: int) -> Bool:
        """Which regions (r,) have been removed by a stored step."""
        steps = self.steps
        names = steps.removed[int(steps.stage[step])] if steps.removed else ()
        return np.isin(self.nodes.region_names, names)

    def evaluate(
        self, points: ArrayLike, steps: int | Sequence[int] | None = None, *, side: Side = "first"
    ) -> Evaluation:
        """Displacement, stress and region at any points (q, 2): `.displacement` (k, q, 2), `.stress` (k, q, 3).

        steps: indices of k stored steps, negative from the end; all by default. Stress is sxx, syy, sxy. Outside all
        regions, and for coordinates beyond 1e100, the values are NaN and `.region` is "". On an outer boundary they are
        the limits from inside; on a crack or interface those of the first side, or of the second with side="second". At
        crack tips, where the stress is infinite, it is NaN. Only the result file is needed.

        Raises ValueError for points of another shape or an unknown side, IndexError for a step that is not stored,
        ResultFileError for files without stored steps and those of earlier versions.
        """
        from pbem.results.evaluation import Side

        if side not in get_args(Side):
            raise ValueError(f"side: found {side!r}; expected one of {', '.join(get_args(Side))}")
        if not len(self.steps):
            raise ResultFileError(str(self.path), "holds no load step yet")
        tips = find_tips(self.elements, self.nodes.curve_names, self.tips)
        places = np.array([complex(*tip) for tip in sorted(tips)], dtype=complex)
        return self._evaluator.evaluate(points, self.choose_steps(steps), places, side)

    @cached_property
    def _evaluator(self) -> Evaluator:
        from pbem.results.evaluation import Evaluator  # here, as a run needs it for its file and never for this

        return Evaluator(self.path, self.nodes, self.elements, self.steps, self.configuration)

    def choose_steps(self, steps: int | Sequence[int] | None = None) -> list[int]:
        """Indices from 0 of stored steps; given ones may be negative, from the end. None selects all.

        Raises IndexError for a step that is not stored, ValueError for what are no indices.
        """
        count = len(self.steps)
        if steps is None:
            return list(range(count))
        try:
            chosen = np.atleast_1d(np.asarray(steps))
        except ValueError:  # lists of different lengths
            chosen = np.atleast_1d(np.nan)
        if chosen.ndim != 1 or (chosen.size and chosen.dtype.kind not in "iu"):
            raise ValueError(f"steps: found {steps!r}; expected indices of stored steps, such as [-1]")
        for each in chosen:
            if not -count <= each < count:
                raise IndexError(f"steps: there is no stored step with index {each}; {count} are stored")
        return [int(each) % count for each in chosen]

    def to_dataframe(self, what: str) -> Any:
        """A pandas.DataFrame of an interface, crack or contact, with one row per stored step and pair.

        what: its name, or "steps", "reactions", "rigid", "tips", "interior", or "contact" for all interfaces together;
        use "contact.NAME" for an interface with one of these names. Columns are named as in the file.

        Raises ImportError if pandas is not installed, ResultFileError if nothing in the file has this name.
        """
        return _load_module("tables").make_dataframe(self, what)

    def plot(self, **options: Any) -> Any:
        """A matplotlib Figure: the displaced bodies; with curve= quantities along curves; with field= alone a map.

        curve: one or several names. field: the quantity, or a list of quantities along curves. step: index of a stored
        step, by default the last. x: "arc_length", "angle", "x" or "y". xlim, ylim: limits. ax: axes to draw into.
        All options and errors: `pbem.results.drawing.plot`.
        """
        return _load_module("drawing").plot(self, **options)

    def __repr__(self) -> str:
        return _load_module("summary").summarise(self)

    def _repr_html_(self) -> str:
        return _load_module("summary").summarise_html(self)

    def find_curve_ends(self, name: str) -> Real:
        """(2, 2): start and end of a curve; NaN in files of earlier versions."""
        start, end, _ = self.find_curve_course(name)
        return np.array([[start.real, start.imag], [end.real, end.imag]])

    def find_curve_course(self, name: str) -> tuple[complex, complex, complex]:
        """Start and end of a curve, and its direction at the start; NaN in files of earlier versions."""
        stored = self._configured
        if name not in stored.get("curves", {}):
            unknown = complex(np.nan, np.nan)
            return unknown, unknown, unknown
        legs = stored["curves"][name]["legs"]
        start, way, end = (complex(*point) for point in (legs[0]["start"], legs[0]["end"], legs[-1]["end"]))
        if legs[0]["center"] is None:
            tangent = way - start
        else:
            tangent = 1j * np.sign(legs[0]["sweep"]) * (start - complex(*legs[0]["center"]))
        origin = complex(*stored["origin"])
        return start + origin, end + origin, complex(tangent / abs(tangent))

    @cached_property
    def _configured(self) -> Mapping[str, Any]:
        """The configuration in force."""
        return json.loads(self.configuration) if self.configuration else {}

    def find_step(self, number: int) -> int:
        """Index of the load step with this number. Raises ResultFileError if it is not stored, ValueError if it
        is no whole number."""
        if not isinstance(number, int | np.integer):
            raise ValueError(f"number: found {number!r}; expected the number of a load step")
        found = np.flatnonzero(self.steps.number == number)
        if not len(found):
            stored = ", ".join(map(str, self.steps.number[:20])) + (", ..." if len(self.steps) > 20 else "")
            raise ResultFileError(str(self.path), f"holds no load step {number}; it holds: {stored or 'none'}")
        return int(found[0])

    def _blank(self, values: Real) -> Real:
        if not any(self.steps.removed):
            return values
        gone = np.array([self.find_gone(step) for step in range(len(self.steps))]).reshape(len(self.steps), -1)
        return freeze(np.where(gone[:, self.nodes.region, None], np.nan, values))

    def _load(self, name: str) -> Real:
        with open_quietly(self.path) as file:
            return freeze(file[name][: len(self.steps)])


def _load_module(name: str) -> Any:
    """A module that itself needs Results."""
    return import_module(f"pbem.results.{name}")


def open_results(path: str | os.PathLike[str]) -> Results:
    """Open a result file, up to its last complete step if the run is in progress or was killed.

    Raises ResultFileError if the file does not exist, is not a result file of pbem, or is damaged; TypeError if it is
    no path.
    """
    if not isinstance(path, str | os.PathLike):
        raise TypeError(f"path: found {path!r}; expected the path of a result file")
    source = Path(path)
    if not os.path.isfile(source):  # also of names that no file can have
        raise ResultFileError(str(path), "no such file")
    for attempt in range(ATTEMPTS):
        try:
            with refuse_damage(source):
                return _open(source)
        except ResultFileError:
            # Of a run that is going on, the pages of a step may just be on their way to their places.
            if attempt + 1 == ATTEMPTS or not is_being_written(source):
                raise
            time.sleep(0.1)
    raise AssertionError


def _open(path: Path) -> Results:
    check_contents(path)
    with open_quietly(path) as file:
        if "pbem_version" not in file.attrs:
            raise ResultFileError(str(path), "is an HDF5 file, but not a result file of pbem")
        if "nodes" in file and "all" not in file:
            raise ResultFileError(str(path), "was written by an older version of pbem")
        return _read(path, file)


def _read(path: Path, file: h5py.File) -> Results:
    attributes = dict(file.attrs)
    steps = read_steps(file)
    k = len(steps)
    nodes, elements = file["nodes"], file["elements"]
    return Results(
        path=path,
        **{name: str(attributes[name]) for name in ("title", "case", "pbem_version", "petsc_version")},
        status=_read_status(path, attributes), failure=str(attributes.get("failure", "")),
        configuration=_read_configuration(attributes), overrides=str(attributes.get("overrides", "")),
        ranks=int(attributes["ranks"]),
        units=Units(str(attributes["units_length"]), str(attributes["units_stress"])),
        nodes=Nodes(
            position=freeze(read_array(nodes, "position")), normal=freeze(read_array(nodes, "normal")),
            **{name: read_indices(nodes, name) for name in ("region", "curve", "element")},
            order=int(nodes.attrs["order"]), region_names=read_names(nodes["region"]),
            curve_names=read_names(nodes["curve"]),
        ),
        elements=Elements(
            vertices=freeze(read_array(elements, "vertices")), sweep=freeze(read_array(elements, "sweep")),
            region=read_indices(elements, "region"),
            curve=read_indices(elements, "curve"), crack=freeze(read_array(elements, "crack").astype(bool)),
            tip=read_indices(elements, "tip"),
        ),
        steps=steps,
        reactions=read_reactions(file, k),
        contact=Interfaces(path, read_names(file["contact"]), k, read_traces(file)),
        pairs=_read_pairs(path, file["contact"], k),
        groups=tuple(GeneratedGroup(**each) for each in json.loads(str(file["contact"].attrs["groups"]))),
        tips=read_tips(file, k),
        energy=Energies(*(freeze(read_energy(file, kind, k)) for kind in ENERGIES)),
        balance=read_balance(file, k),
        linearity=read_linearity(file, k),
        interior=read_interior(path, file, k),
        convergence=freeze(read_array(file, "convergence")),
        rigid=read_rigid(file, k),
        notes=read_notes(file),
    )


def _read_configuration(attributes: Mapping[str, Any]) -> str:
    """The text of the configuration, which has to be what it was written as; "" in files of earlier versions."""
    text = str(attributes.get("configuration", ""))
    if text and not isinstance(json.loads(text), dict):
        raise ValueError("the configuration is no table")
    return text


def _read_pairs(path: Path, group: h5py.Group, steps: int) -> AllPairs:
    pairs = AllPairs(path, read_names(group), steps)
    if len(group.attrs["laws"]) != len(pairs.names):
        raise ValueError(f"{len(group.attrs['laws'])} laws of {len(pairs.names)} interfaces")
    return pairs


def _read_status(path: Path, attributes: Mapping[str, Any]) -> str:
    """The status in the file; of a run that was killed, and could not change it, "stopped"."""
    status = str(attributes["status"])
    if status not in STATUSES:
        raise ValueError(f"unknown status {status}")
    return "stopped" if status == "running" and not is_being_written(path) else status
