"""What the commands say to the terminal, and the exit codes with which they end."""

from __future__ import annotations

import contextlib
import os
import sys

from pbem.errors import printable

UNEXPECTED, WRONG_INPUT, NOT_CONVERGED, INTERRUPTED = 1, 2, 3, 130


def tell(text: str) -> None:
    """Print to standard output; names and titles from files must not steer the terminal."""
    print(printable(text, keep="\n"), flush=True)


def say(text: str, rank: int) -> None:
    """Print to standard error, on the first rank."""
    if rank == 0:
        with contextlib.suppress(OSError):  # of a pipe or terminal that has been closed
            sys.stdout.flush()
        with contextlib.suppress(OSError):
            # In one write: Open MPI 5 tells a line that comes in pieces on standard output, or its pieces apart.
            sys.stderr.write(printable(text, keep="\n") + "\n")
            sys.stderr.flush()


def discard_output() -> None:
    """Send the rest of standard output nowhere: flushing it into a closed pipe at the end would fail once more."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
