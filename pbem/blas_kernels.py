"""Kernels of OpenBLAS for a processor that it does not know.

OpenBLAS chooses its kernels by the model of the processor when it is loaded. A model that came out after it gets those
of a processor of 2004, without AVX: products and factorisations then take five to eight times as long. The variable
OPENBLAS_CORETYPE names other kernels; it has to be set before the library is loaded.

    export OPENBLAS_CORETYPE=$(python -m pbem.blas_kernels)
"""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable
from pathlib import Path

CORE_TYPE = "OPENBLAS_CORETYPE"
LIBRARY = "libopenblas.so.0"

# Kernels by what they need of the processor, the best first. What Linux lists it also lets programs use.
NEEDED = {
    "SkylakeX": frozenset({"avx512f", "avx512cd", "avx512dq", "avx512bw", "avx512vl"}),
    "Haswell": frozenset({"avx2", "fma"}),
}
# Kernels that do without AVX2 and FMA: the first is taken for a processor that is not known.
OLD = frozenset({
    "prescott", "generic", "katmai", "coppermine", "northwood", "banias", "atom", "core2", "penryn", "dunnington",
    "nehalem", "sandybridge", "athlon", "opteron", "opteron_sse3", "barcelona", "bobcat", "bulldozer", "nano",
})


def choose_kernels(cpuinfo: Path = Path("/proc/cpuinfo"), ask: Callable[[], str] | None = None) -> str:
    """The name of better kernels than OpenBLAS would take by itself on this processor; "" if its own choice is well.

    cpuinfo: what Linux says of the processor; ask: the name of OpenBLAS's own choice, by default of the library itself,
    in a process aside, as it could not choose anew once it is loaded here.
    """
    better = next((name for name, flags in NEEDED.items() if flags <= _read_flags(cpuinfo)), "")
    return better if better and (ask or _ask_aside)().lower() in OLD else ""


def name_kernels() -> str:
    """The kernels that OpenBLAS uses in this process; "" if it is not loaded. The library is not loaded by this."""
    return _ask(os.RTLD_NOLOAD | os.RTLD_NOW)


def note_old_kernels() -> str | None:
    """What to tell where this process computes with old kernels on a processor that has better ones; None if not.

    Nothing is said of kernels that the user has named.
    """
    if CORE_TYPE in os.environ:
        return None
    used = name_kernels()
    better = choose_kernels(ask=lambda: used)
    if not better:
        return None
    return (
        f"OpenBLAS does not know this processor and uses its kernels of {used!r}: factorisations take several times as "
        f"long; set {CORE_TYPE}={better} before Python starts, or install a newer OpenBLAS"
    )


def _read_flags(cpuinfo: Path) -> frozenset[str]:
    """Flags of the first processor listed; none on other systems and other processors."""
    try:
        lines = cpuinfo.read_text().splitlines()
    except (OSError, UnicodeDecodeError):
        return frozenset()
    return frozenset(next((line for line in lines if line.startswith("flags")), "").partition(":")[2].split())


def _ask(mode: int) -> str:
    try:
        name = ctypes.CDLL(LIBRARY, mode=mode).openblas_get_corename
    except (OSError, AttributeError):
        return ""
    name.restype = ctypes.c_char_p
    return (name() or b"").decode(errors="replace")


def _ask_aside() -> str:
    """The name in a child that ends at once. To be called early: a process with threads must not fork."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            os.write(writer, _ask(os.RTLD_NOW).encode())
        finally:
            os._exit(0)
    os.close(writer)
    with os.fdopen(reader, errors="replace") as said:
        name = said.read()
    os.waitpid(child, 0)
    return name


if __name__ == "__main__":
    print(choose_kernels())
