"""The account of a run: what it ran with, where its time went, and the file of `pbem run --profile`."""

from __future__ import annotations

import json
import os
import platform
import re
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from datetime import datetime
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from pbem.clock import Clock, Share, clock, find_age, sum_up
from pbem.errors import CaseError, LaunchError, PbemError, ResultFileError
from pbem.parallel import describe_library, do_on_first
from pbem.solve.launch.start import list_mapped_files
from pbem.solve.petsc.session import petsc_version
from pbem.solve.problem.step import Reporter
from pbem.version import __version__

# The library's own name tells its version: libdmumps-5.6.so, libdmumps_ptscotch-5.1.2.so.
MUMPS_LIBRARY = re.compile(r"/libdmumps[a-z_]*-(\d+(?:\.\d+)+)\.so")


@cache
def find_mumps_version() -> str:
    """Of the library that this process has loaded with PETSc; "unknown" where its file does not tell."""
    files = (os.path.realpath(file) for file in list_mapped_files() if "mumps" in file)
    return next((match[1] for match in map(MUMPS_LIBRARY.search, files) if match), "unknown")


def list_versions() -> dict[str, str]:
    """Names and versions of what a run computes with."""
    return {
        "pbem": __version__, "PETSc": petsc_version(), "MUMPS": find_mumps_version(), "NumPy": np.__version__,
        "MPI": describe_library(), "Python": platform.python_version(),
    }  # fmt: skip


def describe_start(comm: MPI.Intracomm) -> list[str]:
    """The first lines of a log: when, where, on how many ranks, and with which versions. All ranks together."""
    hosts = comm.allgather(platform.node())
    counts = {host: hosts.count(host) for host in dict.fromkeys(hosts)}
    where = ", ".join(f"{host} ({count})" if len(counts) > 1 else host for host, count in counts.items())
    versions = list_versions()
    said = ", ".join(f"{name} {version}" for name, version in versions.items() if name != "MPI")
    threads = os.environ.get("OMP_NUM_THREADS", "any number of")
    return [
        f"run of {datetime.now().astimezone():%Y-%m-%d %H:%M:%S %z} on {where}, "
        f"{comm.size} rank{'s' * (comm.size != 1)}, {threads} thread{'s' * (threads != '1')} each",
        f"with {said}, {versions['MPI']}",
    ]


@contextmanager
def keep_account(
    comm: MPI.Intracomm, listener: Reporter | None, profile: str | None, others: tuple[Path, ...]
) -> Iterator[None]:
    """Time a run from the start of its process on, tell the listener (of the first rank) where its time went.

    profile: a file that is written at the end, however the run ends; others: files that it must not replace. All ranks
    together. Raises ResultFileError if the profile cannot be written.
    """
    clock.restart()
    clock.add("start", find_age(), time.process_time())
    if profile is not None:
        do_on_first(comm, ResultFileError, lambda: check_profile_path(profile, others))
    try:
        yield
    except (CaseError, LaunchError, ResultFileError):
        raise  # nothing was computed
    except (PbemError, KeyboardInterrupt):  # all ranks alike
        _end(comm, listener, profile)
        raise
    _end(comm, listener, profile)


def _end(comm: MPI.Intracomm, listener: Reporter | None, profile: str | None) -> None:
    if listener is not None:
        with suppress(OSError):  # nobody reads it any more
            listener.tell(describe_time(clock))
    if profile is not None:
        write_profile(comm, clock, profile)


def describe_time(clock: Clock) -> str:
    """One line: the seconds of the outer pieces, which add up to all."""
    whole, shares = clock.read()
    sums = sum_up(shares)
    # Seconds as they are written add up to the whole as it is written, to rounding.
    said = ", ".join(f"{name} {seconds:.2f}" for name, seconds in sums.items())
    return f"seconds: {said}; all {whole:.2f}"


def check_profile_path(path: str | os.PathLike[str], others: tuple[Path, ...]) -> None:
    """Raise ResultFileError if a profile cannot be written there; others: files that it must not replace."""
    target = Path(path)
    if target.is_dir() or not target.parent.is_dir():
        raise ResultFileError(str(path), "the profile cannot be written: found no such folder, or a folder itself")
    if any((each.exists() and target.exists() and target.samefile(each)) or target == each for each in others):
        raise ResultFileError(str(path), "the profile would replace a file of the run; expected a name of its own")
    if not os.access(target if target.exists() else target.parent, os.W_OK):
        raise ResultFileError(str(path), "the profile cannot be written there: no permission")


def write_profile(comm: MPI.Intracomm, clock: Clock, path: str | os.PathLike[str]) -> None:
    """Write the pieces of all ranks: JSON if the name ends so, else a table. All ranks together; the first writes."""
    whole, shares = clock.read()
    own = {
        "seconds": whole, "processor_seconds": time.process_time(), "peak_memory": read_peak_memory(),
        "pieces": {name: vars(share) for name, share in shares.items()},
    }  # fmt: skip
    ranks, hosts = comm.gather(own), comm.gather(platform.node())
    if ranks is None or hosts is None:
        return
    target = Path(path)
    account = {
        "date": f"{datetime.now().astimezone():%Y-%m-%dT%H:%M:%S%z}", "versions": list_versions(),
        "seconds": whole, "pieces": sum_up(shares),
        "ranks": [{"rank": number, "host": host, **rank} for number, (host, rank) in
                  enumerate(zip(hosts, ranks, strict=True))],
    }  # fmt: skip
    text = json.dumps(account, indent=1) if target.suffix == ".json" else "\n".join(tabulate(account))
    target.write_text(text + "\n", encoding="utf-8")


def tabulate(account: Mapping[str, Any]) -> list[str]:
    """Lines of a table: seconds of the first rank and of the slowest, part of the whole, calls and bytes by piece."""
    ranks = account["ranks"]
    first = {name: Share(**share) for name, share in ranks[0]["pieces"].items()}
    whole = account["seconds"]
    versions = ", ".join(f"{name} {version}" for name, version in account["versions"].items())
    lines = [
        f"# {account['date']}, {len(ranks)} rank{'s' * (len(ranks) != 1)}, {versions}",
        f"# wall time {whole:.3f} s; peak memory of the ranks, MB: "
        + ", ".join(f"{rank['peak_memory'] / 1e6:.0f}" for rank in ranks),
        "# seconds without those of the pieces within: of the first rank, of its processor, of the slowest rank",
        f"{'piece':28s} {'seconds':>10s} {'%':>6s} {'processor':>10s} {'slowest':>10s} {'calls':>9s} {'bytes':>10s}",
    ]
    for name, share in first.items():
        slowest = max(rank["pieces"].get(name, vars(Share()))["seconds"] for rank in ranks)
        lines.append(f"{name:28s} {share.seconds:10.3f} {100 * share.seconds / whole:6.1f} {share.processor:10.3f} "
                     f"{slowest:10.3f} {share.calls:9d} {share.bytes:10.3g}")
    lines.append(f"{'all':28s} {sum(share.seconds for share in first.values()):10.3f}")
    return lines


def read_peak_memory() -> float:
    """Bytes of memory that this process has had at most; NaN where the system does not tell."""
    try:
        for line in Path("/proc/self/status").read_text().splitlines():
            if line.startswith("VmHWM:"):
                return 1024.0 * int(line.split()[1])
    except OSError:
        pass
    return float("nan")
