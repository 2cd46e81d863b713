#!/usr/bin/env python3
"""Read an exported .vtkhdf file by VTK's own reader and compare every array of every step with the result file's.

usage: check_vtk.py FILE.h5 FILE.vtkhdf [STEPS]

Needs vtk >= 9.4, h5py and numpy; exit 1 and a line for each difference. STEPS: how many there were when the file was
exported, if the run has gone on since (default: as many as the result file has).
"""

import sys

import h5py
import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline as Pipeline
from vtkmodules.vtkIOHDF import vtkHDFReader


def read_blocks(path):
    """Yield place and time of every step, and its blocks by their names."""
    reader = vtkHDFReader()
    reader.SetFileName(path)
    reader.UpdateInformation()
    times = reader.GetOutputInformation(0).Get(Pipeline.TIME_STEPS()) or ()
    for at, time in enumerate(times or [None]):  # a single step is no series to VTK
        if time is None:
            reader.Update()
        else:
            reader.UpdateTimeStep(time)
        whole = reader.GetOutputDataObject(0)
        blocks = {}
        for number in range(whole.GetNumberOfBlocks()):
            name = whole.GetMetaData(number).Get(whole.NAME())
            block = whole.GetBlock(number)
            blocks[name] = block.GetPartition(0) if hasattr(block, "GetPartition") else block
        yield at, time, blocks


def collect_expected(file, at):
    """Arrays of a step by block and name, as the result file has them."""
    expected = {("faces", name): file[f"fields/{name}"][at] for name in file["fields"]}
    for name in ("region", "curve"):
        expected["faces", name] = file[f"nodes/{name}"][...]
    together = file["all/contact"] if "contact" in file["all"] else {}
    for name, data in together.items():
        growing = data.maxshape[0] is None
        if growing or name in ("arc_length", "interface"):
            expected["contact", name] = data[at] if growing else data[...]
    for name in ("KI", "KII", "J", "T") if "all/tips/KI" in file else ():
        expected["tips", name] = file[f"all/tips/{name}"][at].ravel()
    if "interior" in file:
        for name in ("displacement", "stress"):
            expected["interior", name] = file[f"interior/{name}"][at]
    return expected


def compare(results, exported, count=None):
    """The differences, a line each; how many arrays were compared."""
    differences, compared = [], 0
    with h5py.File(results, "r", locking=False) as file:
        values = file["steps/stage"][...] + file["steps/factor"][...]
        seen = 0
        for at, time, blocks in read_blocks(exported):
            seen += 1
            if time is not None and time != values[at]:
                differences.append(f"step {at}: time {time}, not {values[at]}")
            for (block, name), expected in collect_expected(file, at).items():
                array = blocks[block].GetPointData().GetArray(name) if block in blocks else None
                if array is None:
                    differences.append(f"step {at}: no array {name} in {block}")
                    continue
                found = vtk_to_numpy(array)
                if expected.ndim == 2 and expected.shape[1] == 2:
                    expected = np.column_stack([expected, np.zeros(len(expected))])
                same = found.shape == expected.shape and found.dtype.itemsize == expected.dtype.itemsize
                if not same or found.tobytes() != np.ascontiguousarray(expected).tobytes():
                    differences.append(f"step {at}: {block}/{name} differs")
                compared += 1
            compared += compare_faces(file, at, blocks, differences)
        if seen != (count or len(values)):
            differences.append(f"{seen} steps, not {count or len(values)}")
    return differences, compared


def compare_faces(file, at, blocks, differences):
    """What the contacts show on the faces: at each node of a pair's place and normal, the pair's numbers."""
    if "contact" not in file["all"]:
        return 0
    together, faces = file["all/contact"], blocks["faces"]
    where = {}
    for node, (place, normal) in enumerate(zip(file["nodes/position"][...], file["nodes/normal"][...], strict=True)):
        where.setdefault((*place, *np.round(normal, 6) + 0.0), node)
    count = 0
    for pair, (place, normal) in enumerate(zip(together["position"][...], together["normal"][...], strict=True)):
        node = where.get((*place, *np.round(normal, 6) + 0.0))
        if node is None:
            continue
        for name in ("mode", "opening", "slip", "traction_n", "traction_s"):
            found = vtk_to_numpy(faces.GetPointData().GetArray(name))[node]
            if not np.array_equal(found, together[name][at][pair], equal_nan=name != "mode"):
                differences.append(f"step {at}: faces/{name} differs at node {node}")
            count += 1
    return count


if __name__ == "__main__":
    if len(sys.argv) not in (3, 4):
        sys.exit(__doc__)
    faults, number = compare(sys.argv[1], sys.argv[2], *map(int, sys.argv[3:]))
    print("\n".join(faults[:40]) if faults else f"ok: {number} arrays and values are equal bit by bit")
    sys.exit(bool(faults))
