"""What this process was started with - launcher, cores, threads - and whether the ranks of a node fit on it.

The decisions are functions of the numbers that the ranks have read; nothing here knows of MPI.
"""

from __future__ import annotations

import os
import platform
import re
from collections.abc import Iterator, Mapping, MutableMapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from pbem.blas_kernels import note_old_kernels
from pbem.wording import count

# Rank and number of ranks as launchers write them. What was started last comes first: mpirun within a job step of
# Slurm leaves the variables of both.
LAUNCHERS = (
    ("OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE"),  # mpirun of Open MPI
    ("PMI_RANK", "PMI_SIZE"),  # MPICH, Intel MPI, Cray; srun --mpi=pmi2
    ("MV2_COMM_WORLD_RANK", "MV2_COMM_WORLD_SIZE"),  # MVAPICH2
    ("PALS_RANKID", "PALS_SIZE"),  # HPE Cray PALS
    ("FLUX_TASK_RANK", "FLUX_JOB_SIZE"),
)
# Launchers that say the rank alone.
RANK_ONLY = ("PMIX_RANK", "PALS_RANKID", "ALPS_APP_PE")
# From here up Slurm's step numbers stand for the batch script, an interactive shell and the like, not for srun.
SPECIAL_STEPS = 4294967280

# What Open MPI need not look for where a process is alone: networks (0.2 s), and a daemon to start others by.
WITHOUT_OTHERS = {"OMPI_MCA_pml": "ob1", "OMPI_MCA_btl": "self", "OMPI_MCA_ess_singleton_isolated": "1"}

# Of options on the command line that are PETSc's.
PREFIX = "-pbem_"

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
OVERRIDE = "PBEM_ALLOW_OVERSUBSCRIPTION"


@dataclass(frozen=True)
class Launch:
    """rank of this process and number of processes (at least) by the launcher's variable; "": no launcher."""

    rank: int
    ranks: int
    variable: str
    exact: bool = True  # False: the launcher tells the rank only


@dataclass(frozen=True)
class Site:
    """Where one rank runs.

    host: name of the node; online: its cores; cores: numbers of those that the process may use; limit: time on
    cores per time that its control group is granted, None without limit; group: that control group; threads: what
    the user has set, by the name of the variable; kernels: what is to be said of OpenBLAS's, "" if nothing.
    """

    host: str
    online: int
    cores: frozenset[int]
    limit: float | None = None
    group: str = ""
    threads: tuple[tuple[str, int], ...] = ()
    kernels: str = ""


def find_launch(environ: Mapping[str, str]) -> Launch:
    """Rank and number of ranks as the launcher says, without starting MPI; (0, 1) outside of a launcher."""
    for rank, ranks in (*LAUNCHERS, *_find_slurm_step(environ)):
        if environ.get(rank, "").isdigit() and environ.get(ranks, "").isdigit():
            return Launch(int(environ[rank]), int(environ[ranks]), ranks)
    for rank in RANK_ONLY:
        if environ.get(rank, "").isdigit():
            return Launch(int(environ[rank]), int(environ[rank]) + 1, rank, exact=False)
    return Launch(0, 1, "")


def _find_slurm_step(environ: Mapping[str, str]) -> Sequence[tuple[str, str]]:
    """Slurm's variables if srun has started this process as a task of a step, not a shell on a terminal.

    A process in a batch script has SLURM_NTASKS of the job, and SLURM_PROCID 0, but is alone.
    """
    step = environ.get("SLURM_STEP_ID", "")
    if not step.isdigit() or int(step) >= SPECIAL_STEPS or "SLURM_PTY_PORT" in environ:
        return ()
    return (("SLURM_PROCID", "SLURM_STEP_NUM_TASKS"), ("SLURM_PROCID", "SLURM_NTASKS"))


@contextmanager
def skip_networks(environ: MutableMapping[str, str]) -> Iterator[None]:
    """Let Open MPI, if the block loads it, look for no others where no launcher has started this process.

    Afterwards the variables are as before: what this process launches may need networks. Where the user has set one of
    them, none is touched.
    """
    chosen = find_launch(environ).variable or not WITHOUT_OTHERS.keys().isdisjoint(environ)
    added = {} if chosen else WITHOUT_OTHERS
    environ.update(added)
    try:
        yield
    finally:
        for name in added:
            environ.pop(name, None)


def refuse_copies(launch: Launch, world: int, library: str) -> str | None:
    """What to say when a launcher has started several processes that MPI does not join; None if all is well.

    world: size of MPI.COMM_WORLD; library: the MPI that mpi4py uses.
    """
    if world > 1 or launch.ranks <= 1:
        return None
    count = f"{launch.ranks}" if launch.exact else f"at least {launch.ranks}"
    said = f"{launch.variable} = {launch.ranks if launch.exact else launch.rank}"
    return (
        f"{count} processes were started ({said}), but MPI.COMM_WORLD has size {world}: each would compute the whole "
        f"case and write the same file.\n  mpi4py uses {library}: the launcher belongs to another MPI, or gives it no "
        "connection.\n  Start pbem with the mpirun or mpiexec of that MPI; with srun, try --mpi=pmix or another of "
        "`srun --mpi=list`; or build mpi4py and petsc4py with the MPI of the launcher. For one process, start one: "
        "srun -n 1, mpirun -n 1"
    )


def read_site(environ: Mapping[str, str]) -> Site:
    """Where this process runs and what it was given."""
    limit, group = read_cpu_limit()
    return Site(
        host=platform.node(),
        online=os.cpu_count() or 1,
        cores=frozenset(os.sched_getaffinity(0)),
        limit=limit,
        group=group,
        threads=find_threads(environ),
        kernels=note_old_kernels() or "",
    )


def find_threads(environ: Mapping[str, str]) -> tuple[tuple[str, int], ...]:
    """Numbers of threads that the user has set; of a list for nested levels (OMP_NUM_THREADS=4,2) the outermost."""
    found = ((name, environ.get(name, "").split(",")[0].strip()) for name in THREADS)
    return tuple((name, int(text)) for name, text in found if text.isdigit() and int(text) > 0)


def read_cpu_limit(
    mount: Path = Path("/sys/fs/cgroup"), membership: Path = Path("/proc/self/cgroup")
) -> tuple[float | None, str]:
    """Time on cores per time that the control groups of this process grant it, and the group that does; (None, "").

    Version 2: cpu.max, "quota period"; version 1: cpu.cfs_quota_us (-1: none) and cpu.cfs_period_us. The least of
    all groups above counts. In a container the mount shows its own group as root.
    """
    limits: list[tuple[float, str]] = []
    try:
        lines = membership.read_text().splitlines()
    except OSError:
        return None, ""
    for line in lines:
        _, controllers, path = line.split(":", 2)
        if controllers and "cpu" not in controllers.split(","):
            continue
        root = mount / controllers if controllers else mount
        if controllers and not root.is_dir():
            root = mount / "cpu"
        folder = root / path.strip("/")
        for place in (folder, *(above for above in folder.parents if above.is_relative_to(root))):
            limit = _read_quota(place)
            if limit is not None:
                limits.append((limit, str(place)))
    return min(limits, default=(None, ""))


def _read_quota(folder: Path) -> float | None:
    def read(name: str) -> list[str]:
        try:
            return (folder / name).read_text().split()
        except OSError:
            return []

    quota, period = [*read("cpu.max"), *read("cpu.cfs_quota_us"), *read("cpu.cfs_period_us"), "", ""][:2]
    return int(quota) / int(period) if quota.isdigit() and period.isdigit() and int(period) else None


def count_cores(sites: Sequence[Site]) -> float:
    """Cores that the ranks of a node have together: those they may use, or less by their control groups' limits."""
    allowed = float(len(frozenset().union(*(site.cores for site in sites))))
    limits = {site.group: site.limit for site in sites}
    granted = sum(limit if limit is not None else allowed for limit in limits.values())
    return min(allowed, granted)


def refuse_threads(sites: Sequence[Site]) -> str | None:
    """What to say when the user has asked for more threads on a node than it has cores for; None if all is well.

    Ranks of one thread each are never refused: more of them than cores are slow, but what was asked for.
    """
    threads = [max((count for _, count in site.threads), default=1) for site in sites]
    cores = count_cores(sites)
    if max(threads) <= 1 or sum(threads) <= cores:
        return None
    name, most = max((pair for site in sites for pair in site.threads), key=lambda pair: pair[1])
    ranks = count(len(sites), "rank")
    bound = max(len(site.cores) for site in sites) < sites[0].online
    binding = (
        ",\n  or give each rank more cores: mpirun --map-by slot:PE=THREADS or --bind-to none, srun --cpus-per-task"
        if bound
        else ""
    )
    return (
        f"{ranks} on node {sites[0].host} with up to {most} threads each ({name} = {most}) are {sum(threads)} threads, "
        f"but the ranks may use {cores:g} of its {count(sites[0].online, 'core')}.\n  Set {name}=1{binding}; "
        f"{OVERRIDE}=1 overrides this"
    )


def note_ranks(sites: Sequence[Site]) -> str | None:
    """What to tell when the ranks of a node have to take turns; None if each has a core."""
    cores = count_cores(sites)
    if len(sites) <= cores:
        return None
    shared = frozenset().union(*(site.cores for site in sites))
    if len(shared) == 1 and sites[0].online > 1:
        return (
            f"all {len(sites)} ranks on node {sites[0].host} are bound to core {min(shared)} and take turns there, of "
            f"{sites[0].online} cores; unless the job has no more: mpirun --bind-to core or --bind-to none, "
            "srun --cpu-bind=cores"
        )
    return f"more ranks than cores on node {sites[0].host}: {len(sites)} ranks take turns on {count(cores, 'core')}"


def note_threads(sites: Sequence[Site]) -> str | None:
    """What to tell when several ranks may each start a thread for every core, because nobody has set their number."""
    if len(sites) == 1 or any(site.threads for site in sites):
        return None
    return (
        f"{THREADS[0]} is not set: each of {len(sites)} ranks on node {sites[0].host} may start a thread for every "
        f"core; set {THREADS[0]}=1 before Python starts"
    )


def note_kernels(sites: Sequence[Site]) -> str | None:
    """What to tell of kernels of OpenBLAS that do not fit the processor; None if they fit."""
    said = next((site.kernels for site in sites if site.kernels), "")
    return f"node {sites[0].host}: {said}" if said else None


def judge_nodes(nodes: Sequence[Sequence[Site]], allowed: bool) -> tuple[str | None, tuple[str, ...]]:
    """The refusal, or None, and the notes for the ranks of all nodes; each kind is said of the first node it befalls.

    allowed: the user wants it so; what would be a refusal is a note then.
    """
    found = {}
    for judge in (refuse_threads, note_ranks, note_threads, note_kernels):
        said = [text for text in map(judge, nodes) if text]
        if said:
            found[judge] = said[0] + (f" (also on {count(len(said) - 1, 'more node')})" if len(said) > 1 else "")
    refusal = found.pop(refuse_threads, None)
    notes = tuple(found.values())
    if refusal is None or not allowed:
        return refusal, notes
    return None, (re.sub(r"\s*\n\s*", " ", refusal), *notes)


def is_set(environ: Mapping[str, str], name: str) -> bool:
    """Whether the user has said yes by a variable, such as OVERRIDE: to more threads than cores."""
    return environ.get(name, "").lower() in ("1", "yes", "true")


def split_petsc_options(arguments: Sequence[str]) -> tuple[dict[str, str], list[str]]:
    """PETSc options without their prefix, and the other arguments.

    An option's value is the next argument unless that is an option itself (a negative number is none) or a case file.
    """
    petsc: dict[str, str] = {}
    plain: list[str] = []
    waiting = list(arguments)
    while waiting:
        argument = waiting.pop(0)
        if not argument.startswith(PREFIX):
            plain.append(argument)
            continue
        name, equals, value = argument.removeprefix(PREFIX).partition("=")
        if not equals and waiting and not _starts_an_option(waiting[0]):
            value = waiting.pop(0)
        petsc[name] = value
    return petsc, plain


def _starts_an_option(argument: str) -> bool:
    if argument.endswith(".toml"):
        return True
    return argument.startswith("-") and not argument[1:2].isdigit() and argument[1:2] != "."
