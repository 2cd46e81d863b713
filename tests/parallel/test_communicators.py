"""Ranks that compute cases of their own, and ranks that share the cases of a sweep."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

import pbem
from pbem.results.reader import open_results
from tests.cli.cli_sample import BLOCKS
from tests.parallel.launch import launch, launch_snippet

ALONE = """
import sys
from mpi4py import MPI
import pbem

rank = MPI.COMM_WORLD.rank
values = {"interfaces.joint.friction": 0.1 + 0.1 * rank, "stages.shear.steps": 2 + 2 * rank}
if rank == 1:  # the others go on
    for wrong in ({"interfaces.joint.friction": -1}, {"curves.joint.elements": 0}):
        try:
            pbem.run("blocks.toml", "wrong.h5", comm=MPI.COMM_SELF, set=wrong)
        except pbem.CaseError:
            values["title"] = "after an error"

class Failing:
    def __getattr__(self, name):
        def tell(*_):
            raise ZeroDivisionError if name == "accept" else AttributeError
        return tell

if rank == 0:
    try:
        pbem.run("blocks.toml", "broken.h5", comm=MPI.COMM_SELF, reporter=Failing())
    except (ZeroDivisionError, AttributeError):
        pass
    else:
        sys.exit("no exception")
results = pbem.run("blocks.toml", f"rank{rank}.h5", comm=MPI.COMM_SELF, set=values)
assert results.ranks == 1, results.ranks
both = pbem.run("blocks.toml", "both.h5")
assert both.ranks == MPI.COMM_WORLD.size
pair = MPI.COMM_WORLD.Split(rank % 2)
assert pbem.run("blocks.toml", f"pair{rank % 2}.h5", comm=pair).ranks == pair.size
print(f"done {rank}\\n", end="", flush=True)
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with the case."""
    (tmp_path / "blocks.toml").write_text(BLOCKS)
    return tmp_path


def test_each_rank_computes_a_case_of_its_own(folder: Path) -> None:
    done = launch_snippet(3, ALONE, cwd=folder)
    assert done.returncode == 0, done.stderr
    assert sorted(line for line in done.stdout.splitlines() if line.startswith("done")) == [
        "done 0", "done 1", "done 2"]
    for rank in range(3):
        expected = pbem.run(folder / "blocks.toml", folder / "one.h5", force=True, set={
            "interfaces.joint.friction": 0.1 + 0.1 * rank, "stages.shear.steps": 2 + 2 * rank})
        found = open_results(folder / f"rank{rank}.h5")
        np.testing.assert_array_equal(found.displacement, expected.displacement)
        assert found.title == ("after an error" if rank == 1 else "Small blocks")
    whole = open_results(folder / "both.h5")
    for name in ("pair0.h5", "pair1.h5"):
        np.testing.assert_allclose(open_results(folder / name).displacement, whole.displacement, rtol=0, atol=1e-12)
    assert not (folder / "wrong.h5").exists()


def test_what_is_no_communicator_is_refused() -> None:
    for wrong in ("all", 3):
        with pytest.raises(TypeError, match="expected an intra-communicator of mpi4py"):
            pbem.run("blocks.toml", comm=wrong)  # type: ignore[arg-type]


def read(path: Path) -> list[dict[str, str]]:
    """The rows of a table."""
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize(("ranks", "values"), [(2, "0.1:0.9:5"), (3, "0.1,0.9")], ids=["own cases", "together"])
def test_ranks_share_the_cases(folder: Path, ranks: int, values: str) -> None:
    arguments = ["sweep", "blocks.toml", "--set", f"interfaces.joint.friction={values}", "--quantity",
                 "reactions.top.x", "--quantity", "contact.slip.largest"]
    done = launch(ranks, *arguments, "-o", "many.csv", cwd=folder)
    assert (done.returncode, done.stderr) == (0, ""), done.stderr
    count = 5 if ranks == 2 else 2
    assert done.stdout.count("\n") == count + 1 and f"[{count}/{count}]" in done.stdout
    assert launch(1, *arguments, "-o", "one.csv", cwd=folder).returncode == 0
    rows, expected = read(folder / "many.csv"), read(folder / "one.csv")
    assert len(rows) == count
    for one, other in zip(rows, expected, strict=True):
        for name in ("interfaces.joint.friction", "status", "case"):
            assert one[name] == other[name]
        for name in ("reactions.top.x", "contact.slip.largest"):
            assert float(one[name]) == pytest.approx(float(other[name]), rel=1e-9, abs=1e-12)


def test_an_error_of_one_rank_ends_the_sweep_of_all(folder: Path) -> None:
    code = """
import sys, pbem
from pbem.errors import StopError
from pbem.parallel import world
import pbem.sweeps.sweep as sweeps
whole = sweeps.compute_case
def compute(setting, values, *rest):
    if world.rank == 1:
        raise StopError("SIGTERM", "stopped by SIGTERM", 143)
    return whole(setting, values, *rest)
sweeps.compute_case = compute
try:
    pbem.sweep("blocks.toml", {"interfaces.joint.friction": [0.1, 0.2, 0.3, 0.4]}, out="t.csv")
except StopError as error:
    print(f"stopped {error.code}\\n", end="", flush=True)
"""
    done = launch_snippet(2, code, cwd=folder)
    assert (done.returncode, done.stdout.count("stopped 143")) == (0, 2), done.stderr
    assert len(read(folder / "t.csv")) == 2
