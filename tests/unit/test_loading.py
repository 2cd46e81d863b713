"""While modules are loaded nothing is collected; afterwards all is as before, but for what is loaded for good."""

from __future__ import annotations

import gc
import weakref
from collections.abc import Iterator

import pytest

from pbem.loading import load_at_once


class Loop:
    """An object that holds itself."""

    def __init__(self) -> None:
        self.own = self


@pytest.fixture(autouse=True)
def unfrozen() -> Iterator[None]:
    yield
    gc.unfreeze()


@pytest.mark.parametrize("enabled", [True, False])
def test_the_collector_is_as_it_was(enabled: bool) -> None:
    before, stays = gc.isenabled(), gc.get_freeze_count()
    try:
        (gc.enable if enabled else gc.disable)()
        with load_at_once():
            assert not gc.isenabled()
        assert gc.isenabled() == enabled and gc.get_freeze_count() == stays
        with pytest.raises(ImportError), load_at_once(for_good=True):
            raise ImportError
        assert gc.isenabled() == enabled and gc.get_freeze_count() == stays
    finally:
        (gc.enable if before else gc.disable)()


def test_what_is_loaded_for_good_is_left_alone_and_later_objects_are_not() -> None:
    with load_at_once(for_good=True):
        loaded = weakref.ref(Loop())
    later = weakref.ref(Loop())
    gc.collect()
    assert gc.get_freeze_count() > 0 and loaded() is not None and later() is None
