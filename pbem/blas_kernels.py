"""Kernels of OpenBLAS for a processor that it does not know.

OpenBLAS chooses its kernels by the model of the processor when it is loaded. A model that came out after it gets those
of a processor of 2004, without AVX: products and factorisations then take five to eight times as long. The variable
OPENBLAS_CORETYPE names other kernels; it has to be set before the library is loaded.

    export OPENBLAS_CORETYPE=$(python -m pbem.blas_kernels)
"""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

CORE_TYPE = "OPENBLAS_CORETYPE"
LIBRARY = "libopenblas.so.0"

# Seconds. The answer takes hundredths; where memory is short, OpenBLAS may wait for some without end.
PATIENCE = 5.0
ASK = (
    f"import ctypes; ask = ctypes.CDLL({LIBRARY!r}).openblas_get_corename; ask.restype = ctypes.c_char_p; "
    "print(ask().decode())"
)

# Kernels by what they need of the processor, the best first. What Linux lists it also lets programs use.
NEEDED = {
    "SkylakeX": frozenset({"avx512f", "avx512cd", "avx512dq", "avx512bw", "avx512vl"}),
    "Haswell": frozenset({"avx2", "fma"}),
}
# Kernels that do without AVX2 and FMA, by the names of OpenBLAS (driver/others/dynamic.c); the first is what it takes
# for a processor that it does not know.
OLD = frozenset({
    "prescott", "generic", "katmai", "coppermine", "northwood", "banias", "atom", "core2", "penryn", "dunnington",
    "nehalem", "sandybridge", "athlon", "opteron", "opteron_sse3", "barcelona", "bobcat", "bulldozer", "nano",
})


def choose_kernels(cpuinfo: Path = Path("/proc/cpuinfo"), ask: Callable[[str], str] | None = None) -> str:
    """The name of better kernels than OpenBLAS would take by itself on this processor; "" if its own choice is well.

    cpuinfo: what Linux says of the processor. ask: what OpenBLAS takes where the given kernels are named, "" for none;
    by default the library itself is asked, in a process of its own, as it could not choose anew once it is loaded here.
    A library that was built without some kernels takes others.
    """
    fit = _list_fit(cpuinfo)
    ask = ask or _ask_aside
    if not fit or ask("").lower() not in OLD:
        return ""
    return next((name for name in fit if ask(name).lower() == name.lower()), "")


def name_kernels() -> str:
    """The kernels that OpenBLAS uses in this process; "" if it is not loaded. The library is not loaded by this."""
    try:
        ask = ctypes.CDLL(LIBRARY, mode=os.RTLD_NOLOAD | os.RTLD_NOW).openblas_get_corename
    except (OSError, AttributeError):
        return ""
    ask.restype = ctypes.c_char_p
    return (ask() or b"").decode(errors="replace")


def note_old_kernels() -> str | None:
    """What to tell where this process computes with old kernels on a processor that has better ones; None if not.

    Nothing is said of kernels that the user has named.
    """
    if CORE_TYPE in os.environ:
        return None
    used, fit = name_kernels(), _list_fit(Path("/proc/cpuinfo"))
    if not fit or used.lower() not in OLD:
        return None
    return (
        f"OpenBLAS uses its kernels of {used!r}, although the processor has better ones: factorisations take several "
        f"times as long; set {CORE_TYPE}={fit[0]} before Python starts, or install a newer OpenBLAS"
    )


def _list_fit(cpuinfo: Path) -> list[str]:
    """Kernels that the processor can run, the best first."""
    flags = _read_flags(cpuinfo)
    return [name for name, needed in NEEDED.items() if needed <= flags]


def _read_flags(cpuinfo: Path) -> frozenset[str]:
    """Flags of the first processor listed; none on other systems and other processors."""
    try:
        with cpuinfo.open(encoding="utf-8", errors="replace") as lines:  # of large nodes the rest takes long
            return frozenset(next((line for line in lines if line.startswith("flags")), "").partition(":")[2].split())
    except OSError:
        return frozenset()


def _ask_aside(named: str) -> str:
    """The name in a process of its own; "" if that cannot be started, or finds no OpenBLAS. named: "" for none."""
    if not sys.executable:  # in a program that has Python within
        return ""
    own = {name: value for name, value in os.environ.items() if name != CORE_TYPE}
    own |= {"OPENBLAS_NUM_THREADS": "1"} | ({CORE_TYPE: named} if named else {})
    try:
        said = subprocess.run(
            [sys.executable, "-I", "-S", "-c", ASK], env=own, stdin=subprocess.DEVNULL, capture_output=True, text=True,
            errors="replace", timeout=PATIENCE, check=False,
        )  # fmt: skip
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return said.stdout.strip()


if __name__ == "__main__":
    print(choose_kernels())
