"""Cases computed on several ranks, one after the other by the same processes: starting those takes longer than a case.

    mpirun -n 2 python -m scripts.conditions.ranks        what Ranks starts: reads tasks from its input, a line each
"""

from __future__ import annotations

import json
import os
import select
import subprocess
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

import pbem
from pbem.errors import PbemError
from pbem.parallel import world

ROOT = Path(__file__).resolve().parents[2]
MARK = "DONE "
# Of ranks on a machine with fewer cores, in a container as well.
ENVIRONMENT = {
    "OMP_NUM_THREADS": "1", "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "OMPI_MCA_hwloc_base_binding_policy": "none", "PRTE_MCA_hwloc_default_binding_policy": "none",
    "OMPI_MCA_mpi_yield_when_idle": "1", "OMPI_MCA_btl_vader_single_copy_mechanism": "none",
}  # fmt: skip
# Of what ranks print that end.
LAST_LINES = 6
# Seconds without an answer after which they are taken to hang.
PATIENCE = 300.0


@dataclass
class Ranks:
    """Processes of an mpirun that wait for cases; made anew after they have ended."""

    count: int
    process: subprocess.Popen[bytes] | None = None
    buffer: bytes = b""
    errors: Path = field(default_factory=lambda: Path(tempfile.mkstemp(prefix="ranks_", suffix=".txt")[1]))

    def run(self, case: Path, output: Path) -> None:
        """Compute a case; PbemError: with the message of the run, or with what became of the processes."""
        if self.process is None:
            self._start()
        assert self.process and self.process.stdin
        try:
            self.process.stdin.write((json.dumps([str(case), str(output)]) + "\n").encode())
            message = self._wait()
        except BrokenPipeError:
            message = self._fail("ended")
        if message:
            raise PbemError(message)

    def end(self) -> None:
        if self.process is not None:
            self.process.terminate()
            try:
                self.process.wait(10)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()
            self.process, self.buffer = None, b""
        self.errors.unlink(missing_ok=True)

    def _start(self) -> None:
        command = ["mpirun", "--oversubscribe", "-n", str(self.count), sys.executable, "-m", __spec__.name]
        with self.errors.open("wb") as errors:
            self.process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors, cwd=ROOT,
                env={**os.environ, **ENVIRONMENT}, bufsize=0,
            )  # fmt: skip

    def _wait(self) -> str:
        """What the first rank says of a case: nothing, or its message."""
        assert self.process and self.process.stdout
        while b"\n" not in self.buffer:
            if not select.select([self.process.stdout], [], [], PATIENCE)[0]:
                return self._fail(f"gave no answer within {PATIENCE:g} s")
            piece = os.read(self.process.stdout.fileno(), 1 << 16)
            if not piece:
                return self._fail("ended")
            self.buffer += piece
        line, self.buffer = self.buffer.split(b"\n", 1)
        if not line.startswith(MARK.encode()):
            return self._fail(f"wrote {line!r}")
        return str(json.loads(line[len(MARK):]))

    def _fail(self, what: str) -> str:
        said = self.errors.read_text(errors="replace").strip().split("\n")[-LAST_LINES:]
        self.end()
        return "\n".join([f"the ranks {what}", *said])


def work() -> None:
    """Compute the cases that come in; the first rank answers with the message of each, empty where there is none."""
    while True:
        task = world.bcast(json.loads(sys.stdin.readline() or "null") if world.rank == 0 else None)
        if task is None:
            return
        try:
            pbem.run(Path(task[0]), task[1], force=True)
            message = ""
        except PbemError as error:
            message = str(error) or type(error).__name__
        if world.rank == 0:
            print(MARK + json.dumps(message), flush=True)


if __name__ == "__main__":
    work()
