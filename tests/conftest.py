"""What all tests share: starting the program on several ranks."""

from __future__ import annotations

import subprocess
from collections.abc import Callable

import pytest

from tests.parallel.launch import launch, launch_snippet


@pytest.fixture
def mpirun() -> Callable[..., subprocess.CompletedProcess[str]]:
    """`mpirun(ranks, *args, timeout=..., cwd=...)` runs `pbem args...`; see tests/parallel/launch.py."""
    return launch


@pytest.fixture
def mpirun_snippet() -> Callable[..., subprocess.CompletedProcess[str]]:
    """`mpirun_snippet(ranks, code, *args, timeout=..., cwd=...)` runs a piece of Python."""
    return launch_snippet
