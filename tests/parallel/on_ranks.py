"""The same case on several numbers of ranks: run, and held against the first of them."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest

import pbem
from pbem.results.estimator import Estimator
from pbem.results.reader import Results, open_results
from tests.parallel.launch import TIMEOUT

Launch = Callable[..., subprocess.CompletedProcess[str]]

# The command line without the second solution, which makes a run half as long again: for tests that look at no errors.
WITHOUT_ERRORS = """
import sys
import pbem.driver
from pbem.cli import main
from pbem.parallel import world
from pbem.results.estimator import Estimator
pbem.driver.make_estimator = lambda model, mesh, *_: Estimator(model, mesh, None, None, "", world.rank == 0)
sys.exit(main(sys.argv[1:]))
"""

# Commands of the program one after the other, on the same ranks, each within what `prepare` makes of its name; what
# each rank writes is kept apart.
PREPARE_NOTHING = "from contextlib import nullcontext as prepare\n"
ONE_BY_ONE = """
import contextlib, io, json, os, sys
from pathlib import Path
from pbem.cli import main
from pbem.parallel import world

ended = {}
for name, (folder, arguments) in json.loads(Path(sys.argv[1]).read_text()).items():
    os.chdir(folder)
    out, err = io.StringIO(), io.StringIO()
    with prepare(name), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main(arguments)
    ended[name] = world.gather((code, out.getvalue(), err.getvalue()))
if world.rank == 0:
    Path(sys.argv[2]).write_text(json.dumps(ended))
"""


def run_one_by_one(
    snippet: Launch, ranks: int, commands: Mapping[str, tuple[Path, Sequence[str]]], folder: Path,
    timeout: float = TIMEOUT, before: str = PREPARE_NOTHING,
) -> dict[str, subprocess.CompletedProcess[str]]:
    """What becomes of commands `pbem arguments...` in folders of their own, by one launch: to start takes longer than
    a small case. All ranks have to return the same code; outputs are those of all ranks, one after the other.

    before: a piece of Python that comes first, and defines `prepare`."""
    listed, told = folder / "commands.json", folder / "ended.json"
    given = {name: (str(where), list(arguments)) for name, (where, arguments) in commands.items()}
    listed.write_text(json.dumps(given))
    done = snippet(ranks, before + ONE_BY_ONE, listed, told, timeout=timeout)
    assert done.returncode == 0, done.stdout + done.stderr
    ended = {}
    for name, by_rank in json.loads(told.read_text()).items():
        (code,) = {code for code, _, _ in by_rank}
        out, err = ("".join(each[k] for each in by_rank) for k in (1, 2))
        ended[name] = subprocess.CompletedProcess(list(commands[name][1]), code, out, err)
    return ended


def run_hierarchical(
    snippet: Launch, folder: Path, text: str, ranks: Sequence[int], *options: str, before: str = ""
) -> list[Results]:
    """The results of a case by the hierarchical operator, on each of these numbers of ranks, without estimated errors;
    options: of PETSc; before: a piece of Python that comes first. One rank is this process, where nothing comes first:
    a launch starts the program once more."""
    (folder / "case.toml").write_text(text)
    results = []
    for count in ranks:
        if count == 1 and not (before or options):
            with pytest.MonkeyPatch.context() as patch:
                patch.setattr("pbem.driver.make_estimator", lambda model, mesh, *_: Estimator(model, mesh, None, None))
                results.append(pbem.run(folder / "case.toml", folder / "1.h5", operator="hierarchical"))
            continue
        done = snippet(count, before + WITHOUT_ERRORS, "run", "case.toml", "-o", f"{count}.h5", "--quiet",
                       "--operator", "hierarchical", *options, cwd=folder)  # fmt: skip
        assert done.returncode == 0, done.stderr
        results.append(open_results(folder / f"{count}.h5"))
    return results


def expect_on_all(snippet: Launch, ranks: int, code: str, timeout: float) -> None:
    """A piece of Python, in which `world` is there, comes to its end on so many ranks, and says nothing else."""
    ended = "\nfor rank in world.gather(world.rank) or ():\n    print('ended on', rank)\n"
    done = snippet(ranks, code + ended, timeout=timeout)
    assert done.stdout.splitlines() == [f"ended on {rank}" for rank in range(ranks)], done.stderr


def expect_same_search(results: Sequence[Results]) -> None:
    """Products and statuses are the same, and there are several statuses; fields agree to the tolerance of products."""
    alone = results[0]
    assert any(np.ptp(each.mode[-1]) > 0 for each in alone.contact.values())
    for other in results[1:]:
        np.testing.assert_array_equal(other.convergence["products"], alone.convergence["products"])
        for name, contact in alone.contact.items():
            np.testing.assert_array_equal(other.contact[name].mode, contact.mode)
        for field in ("displacement", "traction"):
            values = getattr(alone, field)
            np.testing.assert_allclose(getattr(other, field), values, rtol=0, atol=1e-9 * np.abs(values).max())
