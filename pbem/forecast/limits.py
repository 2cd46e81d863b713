"""How much memory there is for a run on this node: of the machine, of its control groups, of the job."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

# What batch systems say of the memory of a job on one node. Slurm's are in MB (2^20 bytes) unless a unit is given, 0
# stands for all there is; PBS' are in bytes, where the site sets them (PBS itself has limits by control groups only).
SLURM_NODE, SLURM_CPU = "SLURM_MEM_PER_NODE", "SLURM_MEM_PER_CPU"
SLURM_CPUS = ("SLURM_CPUS_ON_NODE", "SLURM_CPUS_PER_TASK")
PBS_NODE = ("PBS_RESC_MEM", "PBS_RESC_TOTAL_MEM")
UNITS = {"": 0, "b": 0, "k": 1, "kb": 1, "m": 2, "mb": 2, "g": 3, "gb": 3, "t": 4, "tb": 4}
# Version 1 of the control groups has a number near to 2^63 for "no limit".
NO_LIMIT = 2.0**60
OVERRIDE = "PBEM_ALLOW_MEMORY"


@dataclass(frozen=True)
class Limit:
    """So many bytes, and who says so."""

    bytes: float
    source: str


def read_limits(
    environ: Mapping[str, str], meminfo: Path = Path("/proc/meminfo"), mount: Path = Path("/sys/fs/cgroup"),
    membership: Path = Path("/proc/self/cgroup"),
) -> list[Limit]:
    """All limits that can be found, the least first; none where the system tells nothing."""
    found = [
        *_read_machine(meminfo), *_read_groups(mount, membership), *_read_slurm(environ),
        *(Limit(size, name) for name in PBS_NODE if (size := _read_size(environ.get(name, ""), 0))),
    ]
    return sorted(found, key=lambda limit: limit.bytes)


def read_available(meminfo: Path = Path("/proc/meminfo")) -> float | None:
    """Bytes that could be had now without swapping; None where the system does not tell."""
    return _read_meminfo(meminfo).get("MemAvailable")


def _read_meminfo(meminfo: Path) -> dict[str, float]:
    try:
        lines = meminfo.read_text().splitlines()
    except OSError:
        return {}
    split = (line.split() for line in lines)
    return {words[0].rstrip(":"): 1024.0 * int(words[1]) for words in split if len(words) > 1 and words[1].isdigit()}


def _read_machine(meminfo: Path) -> list[Limit]:
    total = _read_meminfo(meminfo).get("MemTotal")
    return [Limit(total, "the machine's memory")] if total else []


def _read_groups(mount: Path, membership: Path) -> list[Limit]:
    """memory.max of version 2, memory.limit_in_bytes of version 1; of the group and all above, the least."""
    try:
        lines = membership.read_text().splitlines()
    except OSError:
        return []
    found = []
    for line in lines:
        _, controllers, path = (*line.split(":", 2), "", "")[:3]
        if controllers and "memory" not in controllers.split(","):
            continue
        root = mount / "memory" if controllers else mount
        folder = root / path.strip("/")
        for place in (folder, *(above for above in folder.parents if above.is_relative_to(root))):
            for name in ("memory.max", "memory.limit_in_bytes"):
                try:
                    text = (place / name).read_text().strip()
                except OSError:
                    continue
                if text.isdigit() and float(text) < NO_LIMIT:
                    found.append(Limit(float(text), f"{name} of the control group"))
    return sorted(found, key=lambda limit: limit.bytes)[:1]


def _read_slurm(environ: Mapping[str, str]) -> list[Limit]:
    node = _read_size(environ.get(SLURM_NODE, ""), 2)
    if node:
        return [Limit(node, SLURM_NODE)]
    each = _read_size(environ.get(SLURM_CPU, ""), 2)
    counts = [int(text) for name in SLURM_CPUS if (text := environ.get(name, "")).isdigit()]
    return [Limit(each * counts[0], f"{SLURM_CPU} of {counts[0]} processors")] if each and counts and counts[0] else []


def _read_size(text: str, unit: int) -> float:
    """Bytes; unit: power of 1024 without a suffix. 0 for what is no size, and for "all there is"."""
    match = re.fullmatch(r"(\d+(?:\.\d+)?)([a-z]*)", text.strip().lower())
    if not match or match[2] not in UNITS:
        return 0.0
    return float(match[1]) * 1024.0 ** (UNITS[match[2]] if match[2] else unit)
