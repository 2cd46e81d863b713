"""The bundled cases give the same results on any number of ranks: the same modes, fields equal but for rounding."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from numpy.typing import NDArray

from tests.cases.bundled import CASES, Solve, solve_together
from tests.parallel.launch import launch_snippet

# One launch for all cases: starting costs more than most of them.
RUN_ALL = """
import sys
from pathlib import Path
import pbem
folder = Path(sys.argv[1])
for case in sys.argv[2:]:
    pbem.run(case, folder / (Path(case).stem + ".h5"))
"""
# Of the largest value in the file: rounding, times the condition of the equations.
ROUNDING = 1e-9

# As much more in derivatives of displacements along elements that are far shorter than the model (as the T-stress is).
DERIVED = 100

# What belongs together has one scale: a field that vanishes but for rounding has none of its own.
SCALES = {
    "displacement": "length", "opening": "length", "slip": "length", "slip_path": "length",
    "traction": "stress", "traction_n": "stress", "traction_s": "stress", "hoop_stress": "stress", "stress": "stress",
    "slip_rate": "rate", "state": "time",
    "KI": "intensity", "KII": "intensity", "T": "stress",
    "reactions": "force", "resultant": "force", "part_resultant": "force", "whole": "force",
    "J": "force",  # per thickness, as forces are: stress times length
    # Parts of the largest value, and of the sums of forces.
    **dict.fromkeys(("penetration", "tension", "cone", "carried"), "part"),
    **dict.fromkeys(("relative", "part_relative", "whole_relative"), "part"),
    **{f"relative_{kind}": "part" for kind in ("reactions", "jumps", "tractions", "factors", "displacement")},
}  # fmt: skip
# A panel with cracks, two bodies.
FOUR = ("panel_friction_opening", "two_blocks_sliding_thst")
# Steps of a proportional load are multiples of one solution; where all sticks, layers that are pulled mirror those that
# are pushed. tests/cases shows both on one rank, and on several they would show nothing else.
SHARED = [name for name in CASES if name not in ("crack_field_steps", "layers_pull")]
GROUPS = {"reactions": "force", "energy": "energy", "linearity": "part"}

Array = NDArray[Any]


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> Solve:
    """`alone(name)` gives the results of a case on one rank."""
    return solve_together(tmp_path_factory)


def launch_all(folder: Path, ranks: int, names: Iterable[str]) -> None:
    """Run cases on so many ranks."""
    run = launch_snippet(ranks, RUN_ALL, folder, *(CASES[name] for name in names), timeout=600)
    assert run.returncode == 0, run.stderr


def read_results(path: Path) -> dict[str, Array]:
    """All datasets of a result file, by their path in it."""
    found = {}
    with h5py.File(path, "r") as file:
        file.visititems(lambda name, item: found.update({name: item[...]}) if isinstance(item, h5py.Dataset) else None)
    return found


def measure_scales(results: dict[str, Array]) -> dict[str, float]:
    """The largest magnitude of each kind of field."""
    scales: dict[str, float] = {"part": 1.0}
    for name, values in results.items():
        kind = find_kind(name)
        if kind:
            scales[kind] = max(scales.get(kind, 0.0), float(np.nanmax(np.abs(values), initial=0.0)))
    # Forces that cancel, as on the two faces of a crack, are known to rounding of what they are made of.
    size = float(np.ptp(results["nodes/position"], axis=0).max())
    scales["force"] = max(scales.get("force", 0.0), size * scales.get("stress", 0.0))
    return scales


def find_kind(name: str) -> str | None:
    """The kind of a field that has rounding errors; None for what has to be the same."""
    group, _, field = name.rpartition("/")
    return GROUPS.get(group) or SCALES.get(field)


def find_differences(one: dict[str, Array], other: dict[str, Array], rounding: float = ROUNDING) -> list[str]:
    """What two runs of a case do not have in common; rounding: allowed, of the largest value."""
    if one.keys() != other.keys():
        return [f"datasets {sorted(one.keys() ^ other.keys())}"]
    scales = measure_scales(one)
    faults = []
    for name, values in one.items():
        kind = find_kind(name)
        if name == "steps/residual":
            continue
        if name == "convergence":
            same = [column for column in values.dtype.names if column not in ("residual", "seconds")]
            equal = all(np.array_equal(values[column], other[name][column]) for column in same)
        elif kind is None:
            equal = np.array_equal(values, other[name])
        else:
            allowed = rounding * scales[kind] * (DERIVED if name.endswith(("hoop_stress", "/T")) else 1)
            equal = np.allclose(values, other[name], rtol=0, atol=allowed, equal_nan=True)
        if not equal:
            faults.append(name)
    return faults


@pytest.mark.parametrize("ranks", [2, 3, 4])
def test_ranks_do_not_change_the_results(ranks: int, alone: Solve, tmp_path: Path) -> None:
    # Each case on two or on three ranks; four processes take turns on fewer cores: one of each kind of model.
    names = FOUR if ranks == 4 else SHARED[3 - ranks :: 2]
    launch_all(tmp_path, ranks, names)
    faults = {
        name: differences
        for name in names
        if (differences := find_differences(read_results(alone(name).path), read_results(tmp_path / f"{name}.h5")))
    }
    assert not faults


def test_a_difference_is_found(alone: Solve) -> None:
    results = read_results(alone("two_blocks").path)
    assert find_differences(results, results) == []
    scales = measure_scales(results)
    assert scales.keys() >= {"length", "stress", "force"}
    for name in ("fields/traction", "contact/interface/slip", "reactions/top", "fields/displacement"):
        kind = find_kind(name)
        assert kind is not None
        changed = results | {name: results[name] + 2 * ROUNDING * scales[kind]}
        assert find_differences(results, changed) == [name]
    modes = results["contact/interface/mode"].copy()
    modes[0, 0] = 2
    assert find_differences(results, results | {"contact/interface/mode": modes}) == ["contact/interface/mode"]
    history = results["convergence"].copy()
    history["stick"][0] += 1
    assert find_differences(results, results | {"convergence": history}) == ["convergence"]
    assert find_differences(results, {"steps/stage": results["steps/stage"]}) != []
