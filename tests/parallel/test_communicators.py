"""Ranks that compute cases of their own, and ranks that share the cases of a sweep."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

import pbem
from pbem.cli import main
from pbem.results.reader import open_results
from tests.cli.cli_sample import BLOCKS
from tests.parallel.launch import launch, launch_snippet
from tests.unit.far_sample import CRACKS

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


# Argument 1: the case. A receive from anybody is open on the communicator as long as the program computes with it.
HOST = """
import sys
import numpy as np
from mpi4py import MPI
import pbem
from pbem.parallel import keep_duplicate
from pbem.solve.preconditioner import subdomains as groups

groups.ONE_GROUP = 0
groups.GROUP_ELEMENTS = groups.BODY_ELEMENTS = 12
world = MPI.COMM_WORLD
comm = world.Dup()
taken = np.full(100_000, -1.0)
request = comm.Irecv(taken)
for k in range(2):
    assert pbem.run(sys.argv[1], f"run{k}.h5", comm=comm, operator="hierarchical").ranks == world.size
assert not request.Test() and (taken == -1).all(), "messages of the program reached the host"
comm.Barrier()
comm.Send(np.array([3.0 + world.rank]), (world.rank + 1) % world.size)
request.Wait()
assert taken[0] == 3 + (world.rank - 1) % world.size and taken[1] == -1
own = keep_duplicate(comm)
assert own is keep_duplicate(comm) and MPI.Comm.Compare(own, comm) == MPI.CONGRUENT
copy = comm.Dup()
assert keep_duplicate(copy) != own
comm.Free()
assert own == MPI.COMM_NULL, "it outlives the communicator it was made of"
copy.Free()
print("done\\n", end="", flush=True)
"""


def test_messages_do_not_reach_the_host_program(tmp_path: Path) -> None:
    (tmp_path / "cracks.toml").write_text(CRACKS)
    done = launch_snippet(2, HOST, "cracks.toml", cwd=tmp_path, timeout=30)
    assert (done.returncode, done.stdout.count("done")) == (0, 2), done.stderr
    expected = pbem.run(tmp_path / "cracks.toml", tmp_path / "one.h5", operator="dense")
    found = open_results(tmp_path / "run1.h5").displacement
    np.testing.assert_allclose(found, expected.displacement, rtol=0, atol=1e-6 * np.abs(found).max())


COUNTED = """
import numpy as np
from mpi4py import MPI
from scripts.counted import CountedComm

comm = CountedComm(MPI.COMM_WORLD)
ranks, rank = comm.size, comm.rank
numbers = np.arange(4.0 * ranks)
for name in dir(MPI.Intracomm):  # all that sends is counted or refused
    if name.lstrip("I").lower().startswith(("all", "bcast", "gather", "reduce", "scatter", "scan", "exscan", "send",
                                           "isend", "recv", "bsend", "ssend", "rsend", "split", "create_")):
        try:
            getattr(comm, name)
        except NotImplementedError:
            continue
        assert name in vars(CountedComm) or name == "Create_keyval", name
other = comm.Dup()
requests = [other.Irecv(np.empty(3), (rank - 1) % ranks, 5), other.Isend(np.ones(3), (rank + 1) % ranks, 5)]
MPI.Request.Waitall(requests)
comm.Alltoall(numbers, np.empty_like(numbers))
comm.bcast(numbers if rank == 1 else None, root=1)
comm.gather(numbers)
kinds, size = comm.ledger.kinds, numbers.nbytes
assert {name: (each.sent, each.received) for name, each in kinds.items()} == {
    "Irecv": (0, 24), "Isend": (24, 0), "Alltoall": (size, size), "bcast": ((0, size), (size, 0))[rank == 1],
    "gather": (size, ranks * size * (rank == 0)),
}, kinds
other.Free()
comm.Free()
"""


def test_what_is_sent_is_counted_or_refused(tmp_path: Path) -> None:
    done = launch_snippet(2, COUNTED, cwd=Path(__file__).parents[2], timeout=60)
    assert done.returncode == 0, done.stderr


def test_what_is_no_communicator_is_refused() -> None:
    for wrong in ("all", 3):
        with pytest.raises(TypeError, match="expected an intra-communicator of mpi4py"):
            pbem.run("blocks.toml", comm=wrong)  # type: ignore[arg-type]


def read(path: Path) -> list[dict[str, str]]:
    """The rows of a table."""
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize(("ranks", "values"), [(2, "0.1:0.9:5"), (3, "0.1,0.9")], ids=["own cases", "together"])
def test_ranks_share_the_cases(folder: Path, ranks: int, values: str, monkeypatch: pytest.MonkeyPatch) -> None:
    arguments = ["sweep", "blocks.toml", "--set", f"interfaces.joint.friction={values}", "--quantity",
                 "reactions.top.x", "--quantity", "contact.slip.largest"]
    done = launch(ranks, *arguments, "-o", "many.csv", cwd=folder)
    assert (done.returncode, done.stderr) == (0, ""), done.stderr
    count = 5 if ranks == 2 else 2
    assert done.stdout.count("\n") == count + 1 and f"[{count}/{count}]" in done.stdout
    monkeypatch.chdir(folder)
    assert main([*arguments, "-o", "one.csv"]) == 0
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
