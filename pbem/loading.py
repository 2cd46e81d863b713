"""Loading of the program: thousands of objects that stay, which the collector of cycles need not go through."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def load_at_once(for_good: bool = False) -> Iterator[None]:
    """Without the collector of cycles while the block imports modules: it finds nothing in them, and is an eighth of
    the time. Afterwards it is as it was before.

    for_good: what is there by then stays until the process ends, and the collector leaves it alone from now on: at the
    end it would go through all of it several times, which takes another eighth. Not where others have objects of their
    own, whose cycles would stay as well.
    """
    collected = gc.isenabled()
    gc.disable()
    try:
        yield
        if for_good:
            gc.freeze()
    finally:
        if collected:
            gc.enable()
