"""Whether a run was started rightly, asked before anything is computed: processes, libraries, threads, shares."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import petsc4py
from mpi4py import MPI

from pbem.environment import OVERRIDE, find_launch, is_set, judge_nodes, read_site, refuse_copies
from pbem.errors import LaunchError
from pbem.mesh.mesh import Mesh
from pbem.model.model import Model
from pbem.parallel import broadcast, describe_library, gather_by_node, refuse_together, world
from pbem.solve.petsc.session import PETSc
from pbem.solve.system.choice import choose_system

# The library itself, not its Fortran and C++ parts: libmpi.so.40, libmpich.so.12, libmpi_cray.so.12.
MPI_LIBRARY = re.compile(r"/lib(mpi|mpich|mpi_cray|mpi_gnu_\d+|mpigcc|mpi_abi|msmpi)\.so[.\d]*$")

# Bytes of address space that OpenBLAS takes at its first call, once for all: at most 128 MB, and a little for lists.
WORK_SPACE = 2**27 + 2**20


@dataclass(frozen=True)
class Libraries:
    """What PETSc is: kinds of its numbers, versions (major, minor), size of its world, MPI libraries in the process."""

    scalar: np.dtype
    integer: np.dtype
    petsc: tuple[int, int]
    petsc4py: tuple[int, int]
    world: int
    mpi: tuple[str, ...] = ()


def check_start(comm: MPI.Intracomm) -> tuple[str, ...]:
    """Notes on how the ranks were started, the same on all.

    Raises LaunchError on all ranks alike: copies that MPI does not join, libraries that do not fit, too many threads;
    MemoryError on a rank that has too little to begin with.
    """
    # The communicator can be a part of the world; what is asked here of the world needs no other rank.
    copies = refuse_copies(find_launch(os.environ), world.size, describe_library())
    if copies:
        raise LaunchError(copies)  # each copy is alone: there is nobody to ask
    files = list_mapped_files()
    refuse_together(comm, refuse_libraries(read_libraries(files), world.size))
    allowed = broadcast(comm, is_set(os.environ, OVERRIDE))
    refusal, notes = judge_nodes(gather_by_node(comm, read_site(os.environ)), allowed)
    if refusal:
        raise LaunchError(refusal)
    claim_work_space(files)
    return notes


def claim_work_space(files: Iterable[str]) -> None:
    """Let OpenBLAS take its work space while it is known that there is some: without, it would ask for it for ever.

    files: that this process has mapped. Raises MemoryError.
    """
    if any("openblas" in file.lower() for file in files):
        np.empty(WORK_SPACE, dtype=np.uint8)  # only asked for, and given back
    np.linalg.solve(np.eye(2), np.ones(2))


def read_libraries(files: Iterable[str]) -> Libraries:
    """What this process has loaded; files: that it has mapped."""
    major, minor = PETSc.Sys.getVersion()[:2]
    own = re.match(r"(\d+)\.(\d+)", petsc4py.__version__)
    return Libraries(
        scalar=np.dtype(PETSc.ScalarType),
        integer=np.dtype(PETSc.IntType),
        petsc=(major, minor),
        petsc4py=(int(own[1]), int(own[2])) if own else (major, minor),
        world=PETSc.COMM_WORLD.getSize(),
        mpi=find_mpi_libraries(files),
    )


def list_mapped_files() -> list[str]:
    """The files that this process has mapped, each once, its libraries among them."""
    try:
        text = Path("/proc/self/maps").read_text()
    except OSError:
        return []
    # A path is all that has slashes in a line.
    return list(dict.fromkeys(re.findall("/.*", text)))


def find_mpi_libraries(files: Iterable[str]) -> tuple[str, ...]:
    """The MPI libraries among the files that a process has mapped."""
    return tuple(sorted({os.path.realpath(file) for file in files if MPI_LIBRARY.search(file)}))


def refuse_libraries(found: Libraries, world: int) -> str | None:
    """What to say when PETSc is not one that the ranks can compute with; None if all is well. world: mpi4py's size."""
    advice = "; build mpi4py, PETSc and petsc4py with one MPI (see `pbem help install`)"
    if found.scalar.kind == "c":
        return f"PETSc computes with complex numbers ({found.scalar}); pbem needs one built with real scalars"
    if found.scalar != np.dtype(np.float64):
        return f"PETSc computes with {found.scalar}; pbem needs one built with double precision"
    if found.integer.kind != "i" or found.integer.itemsize not in (4, 8):
        return f"PETSc counts with {found.integer}; pbem needs one built with integers of 32 or 64 bits"
    if found.petsc != found.petsc4py:
        petsc, own = (".".join(map(str, version)) for version in (found.petsc, found.petsc4py))
        return f"petsc4py {own} does not fit PETSc {petsc}: install petsc4py=={petsc}.* built with this PETSc"
    if len(found.mpi) > 1:
        return f"two MPI libraries are loaded, of mpi4py and of petsc4py or h5py: {', '.join(found.mpi)}{advice}"
    if found.world != world:
        return f"mpi4py sees {world} ranks, PETSc {found.world}: they use different MPI libraries{advice}"
    return None


def check_shares(model: Model, mesh: Mesh, ranks: int) -> None:
    """Raise LaunchError if the model is too small for so many ranks; decided alike on all of them."""
    refusal = choose_system(model, mesh).refuse_ranks(model, mesh, ranks)
    if refusal:
        raise LaunchError(refusal)
