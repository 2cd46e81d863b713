"""Arrays passed from one rank to all: who sends goes on at once, and all get the values."""

from __future__ import annotations

import pytest

from tests.parallel.on_ranks import Launch, expect_on_all

# The first rank's word that it goes on comes before the others are ready to receive: with a sender that waits nobody
# would ever go on.
PASS = """
import numpy as np
from pbem.parallel import world
from pbem.solve.tangent.panel_passing import Passing, receive_ahead

passing = Passing(world)
number, large = np.zeros(1, dtype=np.int32), np.zeros((300, 4000))
if world.rank == 0:
    number[:], large[:] = 5, np.arange(4000)
    passing.send((number, large), 0)
    for rank in range(1, world.size):
        world.send("goes on", rank)
else:
    assert world.recv(source=0) == "goes on"
    passing.send((number, large), 0).wait()
assert number[0] == 5 and (large == np.arange(4000)).all()
passing.finish()

def send_all():
    for each in range(7):
        values = np.full((200, 500), float(each) if world.rank == each % world.size else -1.0)
        yield passing.send((values,), each % world.size)

assert [set(values.ravel()) for (values,) in receive_ahead(send_all())] == [{float(each)} for each in range(7)]
assert list(receive_ahead(())) == []
passing.finish()
"""


@pytest.mark.parametrize("ranks", [1, 2, 3])
def test_who_sends_goes_on(ranks: int, mpirun_snippet: Launch) -> None:
    expect_on_all(mpirun_snippet, ranks, PASS, timeout=60.0)
