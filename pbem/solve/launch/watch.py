"""What ends a run on all ranks together though it befalls one of them: signals, and custom laws that fail.

`Watch` is the reporter of a run on every rank. The program calls a reporter on all ranks alike, so that each call is an
occasion to ask whether one of them has to stop.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from pbem.contact.custom import CustomLaw, find_fault
from pbem.contact.laws import PairLaws
from pbem.errors import ConvergenceError, LawError, StopError
from pbem.model.model import Model
from pbem.parallel import StopSignals
from pbem.solve.problem.step import Iteration, Reporter, Step

# Sums over the answers of a law on two ranks, relative to the sum of their sizes: tractions may differ by rounding.
EQUAL = 1e-6


class Watch:
    """A reporter that hands all on to another (of the first rank), and then looks after signals and laws.

    Calls raise StopError or LawError, on all ranks alike. iterations: since the pass began, those of tries that failed
    as well. most: a pass that comes to halve a step after more of them ends with ConvergenceError ("iteration limit"),
    as it is not worth more; None for as many as it takes. notes: what was told, in order, since they were begun anew.
    """

    def __init__(self, comm: MPI.Intracomm, listener: Reporter, signals: StopSignals) -> None:
        self.comm = comm
        self._listener: Reporter | None = listener
        self._signals = signals
        self._laws: tuple[CustomLaw, ...] = ()
        self.iterations = 0
        self.most: int | None = None
        self.notes: dict[str, None] = {}

    def look_after(self, laws: PairLaws) -> None:
        """From now on, see whether these laws fail or answer differently on different ranks."""
        self._laws = tuple(each.law for each in laws.strengths if isinstance(each.law, CustomLaw))

    def begin(self, model: Model) -> None:
        """Hand on, and count anew."""
        self.iterations = 0
        self._tell("begin", model)

    def note(self, text: str) -> None:
        """Keep, and hand on."""
        self.notes[text] = None
        self._tell("note", text)

    def tell(self, text: str) -> None:
        """Hand on."""
        self._tell("tell", text)

    def start_step(self, stage: int, reached: float, target: float) -> None:
        """Hand on, and check."""
        self._tell("start_step", stage, reached, target)
        self.check()

    def iterate(self, iteration: Iteration) -> None:
        """Hand on, count, and look after the laws."""
        self.iterations += 1
        self._tell("iterate", iteration)
        self.check(stopping=False)

    def pause(self) -> None:
        """Check."""
        self.check()

    def must_stop(self) -> bool:
        """Whether a rank was asked to stop some time ago."""
        overdue = self._signals.overdue
        return overdue if self.comm.size == 1 else bool(self.comm.allreduce(overdue, op=MPI.LOR))

    def accept(self, step: Step) -> None:
        """Check, and hand on."""
        self.check()
        self._tell("accept", step)

    def reject(self, reason: str, detail: str) -> None:
        """Check, and hand on; or end the pass."""
        self.check()
        if self.most is not None and self.iterations > self.most:
            raise ConvergenceError("iteration limit", f"more than {self.most} iterations, and {reason}: {detail}")
        self._tell("reject", reason, detail)

    def _tell(self, method: str, *arguments: object) -> None:
        if self._listener is None:
            return
        try:
            getattr(self._listener, method, _ignore)(*arguments)
        except OSError:  # a pipe or a terminal has been closed
            self._listener = None
            self._signals.ask("reader", "nobody reads the progress any more", 1)

    def check(self, stopping: bool = True) -> None:
        """Raise StopError or LawError on all ranks if one of them has to stop. Called by all together.

        stopping: whether this is the place for it; laws that fail end the run anywhere.
        """
        if self.comm.size == 1 and not self._laws:  # there is nobody to ask
            if stopping and self._signals.asked:
                raise StopError(*self._signals.asked)
            return
        fault = find_fault(self._laws)
        sums = np.concatenate([np.zeros(0), *(law.sums for law in self._laws)])
        own = np.concatenate([[bool(self._signals.asked), bool(fault)], sums])
        alike = np.empty((self.comm.size, len(own)))
        self.comm.Allgather(own, alike)
        for law in self._laws:
            law.sums[:] = 0.0
        if stopping and alike[:, 0].any():
            asked = next(each for each in self.comm.allgather(self._signals.asked) if each)
            raise StopError(*asked)
        if alike[:, 1].any():
            raise LawError(next(text for text in self.comm.allgather(fault) if text))
        for number, law in enumerate(self._laws):
            parts = alike[:, 2 + 6 * number : 8 + 6 * number]
            if (np.abs(parts - parts[0])[:, :3] > EQUAL * parts[:, 3:].max()).any():
                raise LawError(f"the law {law.file} answers differently on different ranks; "
                               "expected the same answer for the same arguments")


def _ignore(*_: object) -> None:
    """What a listener does that does not ask for it."""
