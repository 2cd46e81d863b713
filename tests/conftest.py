"""What all tests share: collecting them, starting the program on several ranks, leaving out errors that nobody sees."""

from __future__ import annotations

import gc
import subprocess
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from tests.parallel.launch import launch, launch_snippet


@pytest.hookimpl(hookwrapper=True)
def pytest_collection() -> Iterator[None]:
    """Collected tests stay to the end: the collector of cycles would go through them again and again."""
    gc.disable()
    yield
    gc.enable()
    gc.freeze()


# What takes long begins first: else one process would end with it while the others have nothing left.
LONGEST_FIRST = ("parallel", "verification", "cli", "cases")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Files are handed out in the order in which they were collected, those of short tests last."""
    places = {name: k for k, name in enumerate(LONGEST_FIRST)}
    items.sort(key=lambda item: places.get(item.path.parent.name, len(places)))


@pytest.fixture
def mpirun() -> Callable[..., subprocess.CompletedProcess[str]]:
    """`mpirun(ranks, *args, timeout=..., cwd=...)` runs `pbem args...`; see tests/parallel/launch.py."""
    return launch


@pytest.fixture
def mpirun_snippet() -> Callable[..., subprocess.CompletedProcess[str]]:
    """`mpirun_snippet(ranks, code, *args, timeout=..., cwd=...)` runs a piece of Python."""
    return launch_snippet


@pytest.fixture
def without_errors(monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs in this process have no second solution, which takes a third of a small one: for tests that look at no
    estimated errors."""
    # Imported here: what it starts of MPI leaves variables in the environment, which the processes of the tests would
    # take for those of a launcher.
    from pbem import driver
    from pbem.results.estimator import Estimator

    def make_none(model: Any, mesh: Any, *_: Any) -> Estimator:
        return Estimator(model, mesh, None, None)

    monkeypatch.setattr(driver, "make_estimator", make_none)
