"""A result file for ParaView and PyVista: VTKHDF, all stored steps, referring to the result file where HDF5 can.

The file is a collection of blocks - faces, contact, tips, interior - each an unstructured grid that does not change,
with arrays that do: those of one step after the other, as the specification of VTKHDF 2 wants them. Where a stored
array has this order already, a virtual dataset refers to it. What has to be rearranged is copied, as is what the file
has zeros for that mean nothing; and everything is where a run goes on writing, since it locks its file.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from pbem.arrays import Integer, Real
from pbem.errors import ResultFileError
from pbem.results.journal import is_being_written
from pbem.results.opening import has_journal, open_quietly
from pbem.results.reader import Results
from pbem.results.vtk_cells import Cells, join_faces, join_grid, join_pairs, match_pairs

VERSION = (2, 2)
# What stands where a quantity has no value: for numbers NaN.
NO_STATUS = -1
TIPS = ("KI", "KII", "J", "T")
# Stored as zero, not as NaN, at the nodes of regions that a stage has removed.
ZERO_WHERE_REMOVED = ("fields/displacement", "fields/traction")


@dataclass(frozen=True)
class Growing:
    """An array of every step: name; the dataset of the result file, (k, n) or (k, n, c), and the numbers of its columns
    at the points, -1 where there are none; without them the columns are the points."""

    name: str
    dataset: str
    columns: Integer | None = None


@dataclass(frozen=True)
class Grid:
    """points (n, 2); static: arrays (n,) or (n, 2) at the points; of_cells: arrays (c,); words: lists of names."""

    name: str
    points: Real
    cells: Cells
    growing: tuple[Growing, ...]
    static: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    of_cells: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    words: Mapping[str, Sequence[str]] = field(default_factory=dict)


@dataclass(frozen=True)
class Exported:
    """What was written: the blocks' names, the number of steps, and whether arrays refer to the result file."""

    blocks: tuple[str, ...]
    steps: int
    refers: bool


def export_vtkhdf(results: Results, target: Path, copy: bool = False) -> Exported:
    """Write all stored steps for ParaView and PyVista; copy: with a copy of every array, none refers to another file.

    Raises ResultFileError if no step is stored yet, or the file cannot be written.
    """
    if not len(results.steps):
        raise ResultFileError(str(results.path), "holds no load step yet")
    refers = not copy and not is_being_written(results.path) and not has_journal(results.path)
    part = target.with_name(f".{target.name}.{os.getpid()}")
    try:
        with open_quietly(results.path) as source:
            blocks = list_blocks(results, source)
            try:
                with h5py.File(part, "w", libver=("v108", "v110"), track_order=True) as file:
                    _write(file, results, source, blocks, target.parent if refers else None)
                part.replace(target)
            except OSError as error:
                raise ResultFileError(str(target), f"cannot be written ({error.strerror or error})") from error
    finally:
        part.unlink(missing_ok=True)
    return Exported(tuple(block.name for block in blocks), len(results.steps), refers)


def list_blocks(results: Results, source: h5py.File) -> list[Grid]:
    """What the file shows, as far as the results have it."""
    blocks = [_make_faces(results, source)]
    if results.pairs.names:
        blocks.append(_make_contact(results, source))
    if results.tips:
        blocks.append(_make_tips(results))
    if results.interior is not None and len(results.interior.position):
        interior = results.interior
        growing = tuple(Growing(name, f"interior/{name}") for name in ("displacement", "stress"))
        cells = join_grid(results.configuration, interior.region)
        blocks.append(Grid("interior", interior.position, cells, growing, {"region": interior.region.astype("i4")},
                            words={"region_names": results.nodes.region_names}))
    return blocks


def _make_faces(results: Results, source: h5py.File) -> Grid:
    nodes = results.nodes
    growing = [Growing(name, f"fields/{name}") for name in ("displacement", "traction", "hoop_stress")
               if f"fields/{name}" in source]
    if results.pairs.names:
        columns = match_pairs(nodes, results.pairs)
        growing += [Growing(name, f"all/contact/{name}", columns) for name in _list_quantities(source)]
    static = {"region": nodes.region.astype("i4"), "curve": nodes.curve.astype("i4"), "normal": nodes.normal}
    words = {"region_names": nodes.region_names, "curve_names": nodes.curve_names}
    of_cells = {name: getattr(results.elements, name).astype("i4") for name in ("region", "curve")}
    cells = join_faces(results.elements, nodes, results.tips)
    return Grid("faces", nodes.position, cells, tuple(growing), static, of_cells, words)


def _list_quantities(source: h5py.File) -> list[str]:
    return [name for name in ("mode", "opening", "slip", "traction_n", "traction_s") if f"all/contact/{name}" in source]


def _make_contact(results: Results, source: h5py.File) -> Grid:
    pairs = results.pairs
    growing = tuple(Growing(name, f"all/contact/{name}") for name in source["all/contact"]
                    if source["all/contact"][name].maxshape[0] is None)
    static = {"interface": pairs.interface.astype("i4"), "arc_length": pairs.arc_length, "normal": pairs.normal}
    return Grid("contact", pairs.position, join_pairs(pairs.interface), growing, static,
                 {"interface": np.unique(pairs.interface).astype("i4")}, {"interface_names": pairs.names})


def _make_tips(results: Results) -> Grid:
    """Both ends of every crack, those that are no tips with NaN."""
    names = tuple(results.tips)
    places = np.array([results.find_curve_ends(name) for name in names]).reshape(-1, 2)
    static = {"crack": np.repeat(np.arange(len(names)), 2).astype("i4"),
              "end": np.tile([0, 1], len(names)).astype("i4")}
    growing = tuple(Growing(kind, f"all/tips/{kind}") for kind in TIPS)
    return Grid("tips", places, Cells.vertices(len(places)), growing, static, words={"crack_names": names})


def _write(
    file: h5py.File, results: Results, source: h5py.File, blocks: Sequence[Grid], folder: Path | None
) -> None:
    """folder: that of the file, if arrays are to refer to the result file."""
    root = file.create_group("VTKHDF", track_order=True)
    _mark(root, "MultiBlockDataSet")  # PyVista knows no other collection
    assembly = root.create_group("Assembly", track_order=True)
    for number, block in enumerate(blocks):
        group = root.create_group(block.name, track_order=True)
        _mark(group, "UnstructuredGrid")
        group.attrs["Index"] = np.int64(number)
        assembly[block.name] = h5py.SoftLink(f"/VTKHDF/{block.name}")
        _write_grid(group, block.points, block.cells)
        steps = _write_steps(group, results)
        for name, values in block.static.items():
            group["PointData"][name] = _widen(values)
            steps["PointDataOffsets"][name] = np.zeros(len(results.steps), dtype="i8")
        for name, values in block.of_cells.items():
            group["CellData"][name] = values
            steps["CellDataOffsets"][name] = np.zeros(len(results.steps), dtype="i8")
        _write_words(group, steps, results, block)
        for each in block.growing:
            if each.dataset in source:
                _write_growing(group, steps, results, source, each, len(block.points), folder)
    _write_steps(root, results)  # VTK 9.7 shows the first step at all times unless the whole is said to be a series
    for name in ("title", "units_length", "units_stress"):
        file.attrs[name] = source.attrs[name]


def _mark(group: h5py.Group, kind: str) -> None:
    group.attrs["Version"] = np.array(VERSION, dtype="i8")
    group.attrs.create("Type", kind.encode("ascii"), dtype=h5py.string_dtype("ascii", len(kind)))


def _write_grid(group: h5py.Group, points: Real, cells: Cells) -> None:
    group["Points"] = _widen(points)
    group["Connectivity"], group["Offsets"] = cells.connectivity.astype("i8"), cells.offsets.astype("i8")
    group["Types"] = cells.types.astype("u1")
    for name, count in (("Points", len(points)), ("Cells", len(cells.types)),
                        ("ConnectivityIds", len(cells.connectivity))):
        group[f"NumberOf{name}"] = np.array([count], dtype="i8")
    for name in ("PointData", "CellData", "FieldData"):
        group.create_group(name, track_order=True)


def _write_steps(group: h5py.Group, results: Results) -> h5py.Group:
    """Time: the number of finished stages plus the fraction reached of the present one."""
    steps = group.create_group("Steps", track_order=True)
    steps.attrs["NSteps"] = np.int64(len(results.steps))
    steps["Values"] = results.steps.stage + results.steps.factor
    zeros = np.zeros(len(results.steps), dtype="i8")
    for name in ("PartOffsets", "PointOffsets", "CellOffsets", "ConnectivityIdOffsets"):
        steps[name] = zeros if name in ("PartOffsets", "PointOffsets") else zeros[:, None]
    steps["NumberOfParts"] = zeros + 1
    for name in ("PointDataOffsets", "CellDataOffsets", "FieldDataOffsets", "FieldDataSizes"):
        steps.create_group(name, track_order=True)
    return steps


def _write_words(group: h5py.Group, steps: h5py.Group, results: Results, block: Grid) -> None:
    """Names, by their numbers; and the number of the load step."""
    k = len(results.steps)
    for name, words in block.words.items():
        # VTK reads no strings that are marked as UTF-8, but takes those of ASCII as such.
        text = [word.encode("utf-8") for word in words]
        group["FieldData"][name] = np.array(text, dtype=h5py.string_dtype("ascii"))
        steps["FieldDataOffsets"][name] = np.zeros(k, dtype="i8")
        steps["FieldDataSizes"][name] = np.tile([1, len(words)], (k, 1))
    group["FieldData"]["step"] = results.steps.number.astype("i8")
    steps["FieldDataOffsets"]["step"] = np.arange(k)
    steps["FieldDataSizes"]["step"] = np.ones((k, 2), dtype="i8")


def _write_growing(
    group: h5py.Group, steps: h5py.Group, results: Results, source: h5py.File, each: Growing, count: int,
    folder: Path | None,
) -> None:
    stored = source[each.dataset]
    k, data = len(results.steps), group["PointData"]
    steps["PointDataOffsets"][each.name] = count * np.arange(k)
    vector = each.dataset.endswith(("displacement", "traction"))
    width = 3 if vector else int(np.prod(stored.shape[1:])) // stored.shape[1] if each.columns is None else 1
    width = 1 if each.dataset.startswith("all/tips/") else width
    shape = (k * count,) if width == 1 else (k * count, width)
    kind = np.dtype("i1") if stored.dtype.kind == "b" else stored.dtype  # VTK knows no truth values
    blanked = each.dataset in ZERO_WHERE_REMOVED and any(results.steps.removed)
    if folder is not None and each.columns is None and kind == stored.dtype and not blanked:
        _refer(group, each.name, results.path, stored, shape, k, folder)
    else:
        whole = data.create_dataset(each.name, shape=shape, dtype=kind)
        for at in range(k):
            values = stored[at]
            if each.columns is not None:
                values = _rearrange(values, each.columns)
            if blanked:
                values = np.where(results.find_gone(at)[results.nodes.region, None], np.nan, values)
            whole[at * count : (at + 1) * count] = _widen(values) if vector else values.reshape(count, *shape[1:])


def _rearrange(values: NDArray[Any], columns: Integer) -> NDArray[Any]:
    nothing = np.nan if values.dtype.kind == "f" else NO_STATUS
    return np.where(columns >= 0, values[np.maximum(columns, 0)], values.dtype.type(nothing))


def _refer(
    group: h5py.Group, name: str, path: Path, stored: h5py.Dataset, shape: tuple[int, ...], k: int, folder: Path
) -> None:
    """A virtual dataset; what it refers to is missing where all is NaN, or -1."""
    layout = h5py.VirtualLayout(shape, stored.dtype)
    where = os.path.relpath(path.resolve(), folder.resolve())
    source = h5py.VirtualSource(where, stored.name, stored.shape, stored.dtype, stored.maxshape)[:k]
    if len(shape) == 2 and shape[1] > stored.shape[2]:
        layout[:, : stored.shape[2]] = source
        # Never written, it takes no room; its zeros are the third component.
        zeros = group.require_dataset("zeros", shape[:1], stored.dtype, chunks=(min(shape[0], 65536),), fillvalue=0.0)
        layout[:, stored.shape[2]] = h5py.VirtualSource(".", zeros.name, shape[:1], stored.dtype)
    else:
        layout[...] = source
    nothing = np.nan if stored.dtype.kind == "f" else NO_STATUS
    group["PointData"].create_virtual_dataset(name, layout, fillvalue=nothing)


def _widen(values: NDArray[Any]) -> NDArray[Any]:
    """(n, 3) of vectors (n, 2); other arrays as they are."""
    return np.column_stack([values, np.zeros(len(values))]) if values.ndim == 2 and values.shape[1] == 2 else values
