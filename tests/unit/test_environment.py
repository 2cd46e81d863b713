"""What the program makes of a launcher's variables, of cores, limits and threads: functions of the numbers alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pbem.environment import (
    Launch,
    Site,
    count_cores,
    find_launch,
    find_threads,
    judge_nodes,
    note_ranks,
    note_threads,
    read_cpu_limit,
    refuse_copies,
    refuse_threads,
)
from pbem.solve.launch.start import Libraries, find_mpi_libraries, refuse_libraries
from pbem.solve.petsc.shares import fits_ranks, refuse_shares, share_equally

BATCH = {"SLURM_JOB_ID": "7", "SLURM_NTASKS": "8", "SLURM_NPROCS": "8", "SLURM_PROCID": "0", "SLURM_LOCALID": "0"}
STEP = BATCH | {"SLURM_STEP_ID": "0", "SLURM_STEP_NUM_TASKS": "8", "SLURM_PROCID": "3"}

LAUNCHES = {
    "none": ({}, (0, 1)),
    "Open MPI": ({"OMPI_COMM_WORLD_RANK": "2", "OMPI_COMM_WORLD_SIZE": "4"}, (2, 4)),
    "MPICH": ({"PMI_RANK": "1", "PMI_SIZE": "4"}, (1, 4)),
    "MVAPICH2": ({"MV2_COMM_WORLD_RANK": "1", "MV2_COMM_WORLD_SIZE": "4"}, (1, 4)),
    "PALS": ({"PALS_RANKID": "3", "PMI_RANK": "3", "PMI_SIZE": "4"}, (3, 4)),
    "ALPS": ({"ALPS_APP_PE": "3"}, (3, 4)),
    "PMIx alone": ({"PMIX_RANK": "0"}, (0, 1)),
    "srun": (STEP, (3, 8)),
    "srun of an old Slurm": ({k: v for k, v in STEP.items() if k != "SLURM_STEP_NUM_TASKS"}, (3, 8)),
    "batch script": (BATCH, (0, 1)),
    "batch script, step of its own": (BATCH | {"SLURM_STEP_ID": "4294967291"}, (0, 1)),
    "interactive step": (STEP | {"SLURM_STEP_ID": "4294967290"}, (0, 1)),
    "shell on a terminal": (STEP | {"SLURM_PTY_PORT": "34889"}, (0, 1)),
    "not a task": ({k: v for k, v in STEP.items() if k != "SLURM_PROCID"}, (0, 1)),
    "one task of srun": (BATCH | {"SLURM_STEP_ID": "3", "SLURM_STEP_NUM_TASKS": "1"}, (0, 1)),
    # mpirun starts its daemons on the nodes by srun: its own variables count.
    "mpirun in a step": (STEP | {"OMPI_COMM_WORLD_RANK": "5", "OMPI_COMM_WORLD_SIZE": "16"}, (5, 16)),
    "nonsense": ({"PMI_RANK": "x", "PMI_SIZE": "4"}, (0, 1)),
}


@pytest.mark.parametrize("name", LAUNCHES)
def test_the_launcher_tells_rank_and_ranks(name: str) -> None:
    environ, expected = LAUNCHES[name]
    launch = find_launch(environ)
    assert (launch.rank, launch.ranks) == expected


def test_copies_are_refused_with_both_numbers_and_the_library() -> None:
    said = refuse_copies(Launch(0, 4, "PMI_SIZE"), 1, "Open MPI v4.1.4")
    assert said is not None
    for part in ("4 processes", "PMI_SIZE = 4", "MPI.COMM_WORLD has size 1", "Open MPI v4.1.4", "--mpi=pmix"):
        assert part in said
    assert "at least 2 processes were started (PMIX_RANK = 1)" in str(
        refuse_copies(find_launch({"PMIX_RANK": "1"}), 1, "MPICH")
    )


@pytest.mark.parametrize(("ranks", "world"), [(1, 1), (4, 4), (1, 4), (2, 4)])
def test_joined_ranks_are_no_copies(ranks: int, world: int) -> None:
    assert refuse_copies(Launch(0, ranks, "PMI_SIZE"), world, "") is None


def place(cores: set[int], threads: int = 0, limit: float | None = None, group: str = "", online: int = 8) -> Site:
    """A rank on the node n1."""
    set_threads = (("OMP_NUM_THREADS", threads),) if threads else ()
    return Site("n1", online, frozenset(cores), limit, group, set_threads)


ALL = set(range(8))


def test_cores_of_a_node_are_those_of_all_its_ranks_within_the_limits() -> None:
    assert count_cores([place({0, 1}), place({1, 2})]) == 3
    assert count_cores([place(ALL, limit=2.5, group="a"), place(ALL, limit=2.5, group="a")]) == 2.5
    assert count_cores([place(ALL, limit=2.0, group="a"), place(ALL, limit=2.0, group="b")]) == 4
    assert count_cores([place(ALL, limit=64.0, group="a")]) == 8
    assert count_cores([place(ALL, limit=2.0, group="a"), place(ALL)]) == 8


@pytest.mark.parametrize(
    ("ranks", "threads", "refused"),
    [(4, 2, False), (8, 1, False), (16, 1, False), (16, 0, False), (1, 8, False), (1, 9, True), (5, 2, True),
     (2, 8, True)],
)
def test_threads_must_fit_the_cores_but_ranks_need_not(ranks: int, threads: int, refused: bool) -> None:
    said = refuse_threads([place(ALL, threads)] * ranks)
    assert (said is not None) == refused
    if said:
        assert f"{ranks} rank" in said and f"are {ranks * threads} threads" in said and "8 of its 8 cores" in said
        assert "Set OMP_NUM_THREADS=1" in said and "PBEM_ALLOW_OVERSUBSCRIPTION=1" in said and "--bind-to" not in said


def test_ranks_bound_to_a_core_each_leave_none_for_their_threads() -> None:
    said = str(refuse_threads([place({rank}, 4) for rank in range(2)]))
    assert "8 threads" in said and "2 of its 8 cores" in said and "--bind-to none" in said and "PE=" in said


def test_the_largest_of_the_variables_is_named() -> None:
    site = Site("n1", 8, frozenset(ALL), threads=(("OMP_NUM_THREADS", 1), ("MKL_NUM_THREADS", 6)))
    assert "Set MKL_NUM_THREADS=1" in str(refuse_threads([site, site]))
    assert find_threads({"OMP_NUM_THREADS": "4,2", "MKL_NUM_THREADS": "", "OPENBLAS_NUM_THREADS": "x"}) == (
        ("OMP_NUM_THREADS", 4),
    )


def test_ranks_that_take_turns_are_noted() -> None:
    assert note_ranks([place({0, 1})] * 2) is None
    assert "3 ranks take turns on 2 cores" in str(note_ranks([place({0, 1})] * 3))
    together = str(note_ranks([place({5})] * 2))
    assert "all 2 ranks on node n1 are bound to core 5" in together and "--bind-to" in together
    assert "bound" not in str(note_ranks([place({0}, online=1)] * 2))
    assert note_ranks([place({0}), place({1})]) is None
    assert note_ranks([place({5})]) is None


def test_threads_that_nobody_has_set_are_noted() -> None:
    assert "OMP_NUM_THREADS is not set" in str(note_threads([place(ALL)] * 2))
    assert note_threads([place(ALL)]) is None
    assert note_threads([place(ALL, 1)] * 2) is None


def test_nodes_are_judged_together_and_the_user_can_want_it_so() -> None:
    nodes = [[place(ALL, 1)] * 8, [place(ALL, 2)] * 8, [place(ALL, 2)] * 8]
    refusal, notes = judge_nodes(nodes, allowed=False)
    assert refusal is not None and refusal.endswith("(also on 1 more node)") and notes == ()
    refusal, notes = judge_nodes(nodes, allowed=True)
    assert refusal is None and len(notes) == 1 and "16 threads" in notes[0] and "\n" not in notes[0]
    assert judge_nodes([[place(ALL)]], allowed=False) == (None, ())


GROUPS = {
    "version 2, own group": ("0::/job/task\n", {"job/task/cpu.max": "150000 100000"}, 1.5),
    "version 2, group above": ("0::/job/task\n", {"job/cpu.max": "200000 100000", "job/task/cpu.max": "max 100000"}, 2),
    "version 2, the least": ("0::/a/b\n", {"a/cpu.max": "200000 100000", "a/b/cpu.max": "400000 100000"}, 2),
    "version 2, container": ("0::/far/away\n", {"cpu.max": "300000 100000"}, 3),
    "version 2, none": ("0::/a\n", {"a/cpu.max": "max 100000", "cpu.max": "max 100000"}, None),
    "version 1": ("3:cpu,cpuacct:/j\n0::/\n", {"cpu,cpuacct/j/cpu.cfs_quota_us": "400000",
                                             "cpu,cpuacct/j/cpu.cfs_period_us": "100000"}, 4),
    "version 1, none": ("3:cpu:/\n", {"cpu/cpu.cfs_quota_us": "-1", "cpu/cpu.cfs_period_us": "100000"}, None),
    "other controllers": ("5:memory:/\n", {"memory/cpu.max": "100000 100000"}, None),
}  # fmt: skip


@pytest.mark.parametrize("name", GROUPS)
def test_limits_of_control_groups_are_read(name: str, tmp_path: Path) -> None:
    membership, files, expected = GROUPS[name]
    (tmp_path / "membership").write_text(membership)
    for path, text in files.items():
        (tmp_path / "mount" / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "mount" / path).write_text(text + "\n")
    assert read_cpu_limit(tmp_path / "mount", tmp_path / "membership")[0] == expected
    assert read_cpu_limit(tmp_path / "mount", tmp_path / "none") == (None, "")


REAL, LONG = np.dtype(np.float64), np.dtype(np.int64)
GOOD = Libraries(REAL, LONG, (3, 20), (3, 20), 4, ("/usr/lib/libmpi.so.40",))

LIBRARIES = {
    "good": (GOOD, None),
    "32 bits": (Libraries(REAL, np.dtype(np.int32), (3, 18), (3, 18), 4), None),
    "complex": (Libraries(np.dtype(np.complex128), LONG, (3, 20), (3, 20), 4), "complex numbers"),
    "single": (Libraries(np.dtype(np.float32), LONG, (3, 20), (3, 20), 4), "double precision"),
    "versions": (Libraries(REAL, LONG, (3, 20), (3, 18), 4), "petsc4py 3.18 does not fit PETSc 3.20"),
    "alone": (Libraries(REAL, LONG, (3, 20), (3, 20), 1), "mpi4py sees 4 ranks, PETSc 1"),
    "two": (Libraries(REAL, LONG, (3, 20), (3, 20), 4, ("/a/libmpi.so.40", "/b/libmpi.so.12")), "two MPI libraries"),
}


@pytest.mark.parametrize("name", LIBRARIES)
def test_libraries_that_do_not_fit_are_refused(name: str) -> None:
    found, expected = LIBRARIES[name]
    said = refuse_libraries(found, 4)
    assert said is None if expected is None else expected in str(said)


def test_mpi_libraries_are_told_from_their_parts() -> None:
    parts = ["/usr/lib/libmpi_cxx.so.40", "/usr/lib/libmpi_mpifh.so.40", "/usr/lib/openmpi/mca_op_avx.so",
             "/usr/lib/libhdf5_openmpi.so.103", "/opt/lib/libmpifort.so.12", "/usr/lib/libfftw3_mpi.so.3"]
    assert find_mpi_libraries([*parts, "/usr/lib/libmpi.so.40.30.4", "/usr/lib/libmpi.so.40.30.4"]) == (
        "/usr/lib/libmpi.so.40.30.4",
    )
    assert find_mpi_libraries(["/a/libmpi.so.40", "/b/libmpich.so.12"]) == ("/a/libmpi.so.40", "/b/libmpich.so.12")


def test_the_dense_operator_has_a_node_and_an_equal_block_for_every_rank() -> None:
    for ranks in range(1, 20):
        for nodes in range(1, 60):
            blocks = share_equally(2 * nodes, ranks)
            # From PETSc's own check: the same number of rows on all ranks, but for the last.
            equal = len(set(blocks[:-1])) <= 1 and nodes >= ranks
            assert fits_ranks(nodes, ranks, lu=True) == (equal or ranks == 1)
            assert fits_ranks(nodes, ranks, lu=False) == (nodes >= ranks)
    assert refuse_shares(9, 6, lu=True) is None
    assert "18 rows" in str(refuse_shares(9, 8, lu=True)) and "at most 7" in str(refuse_shares(9, 8, lu=True))
    assert refuse_shares(9, 8, lu=False) is None
    assert "2 nodes, fewer than the 8 ranks; start at most 2" in str(refuse_shares(2, 8, lu=False))
