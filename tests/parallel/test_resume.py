"""A run with friction that is killed or fails half-way and is resumed, on any ranks, ends as an uninterrupted one."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

import pbem
from pbem.results.reader import Results, open_results
from tests.cli.cli_sample import BLOCKS
from tests.parallel.launch import make_environment

Launch = Callable[..., subprocess.CompletedProcess[str]]

# Pressed, sheared until part of the joint slips, sheared back until it slips the other way, and half unloaded.
HISTORY = """\
[[stages]]
name = "press"
steps = 2
[stages.boundary.top]
ux = 0.0
uy = -0.01
[[stages]]
name = "shear"
steps = 3
[stages.boundary.top]
ux = 0.0085
[[stages]]
name = "back"
steps = 4
[stages.boundary.top]
ux = -0.006
[[stages]]
name = "lift"
steps = 2
[stages.boundary.top]
uy = -0.005
"""
# The joint gives way before it slips: what is resumed from holds elastic and plastic slip in one.
CASE = BLOCKS[: BLOCKS.index("[[stages]]")] + "tangential_stiffness = 5000.0\n" + HISTORY
STEPS = 11

# The command line, which is killed or interrupted when the step of this number is to be stored, or fails there on all
# ranks.
STOPPING = """
import os, signal, sys
from pbem.cli import main
import pbem.solve.steps.march as solving
from pbem.errors import ConvergenceError
from pbem.parallel import world

how, number, *arguments = sys.argv[1:]
whole = solving.describe_step

def stop(problem, solution, memory, step, stage, factor, *more):
    if step == int(number):
        world.Barrier()
        if how == "kill":
            os.kill(os.getpid(), signal.SIGKILL)
        if how == "fail":
            raise ConvergenceError("mode cycle", "made up")
        os.kill(os.getpid(), signal.SIGINT)
    return whole(problem, solution, memory, step, stage, factor, *more)

solving.describe_step = stop
sys.exit(main(arguments))
"""


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Results]:
    """The results of the uninterrupted run, on one rank."""
    folder = tmp_path_factory.mktemp("whole")
    (folder / "case.toml").write_text(CASE)
    yield pbem.run(folder / "case.toml", folder / "case.h5")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A working directory with the case."""
    (tmp_path / "case.toml").write_text(CASE)
    return tmp_path


def expect_equal(results: Results, whole: Results) -> None:
    """All fields of all steps agree to 1e-9 of their largest value, all modes exactly."""
    assert (results.status, results.failure) == ("finished", "")
    np.testing.assert_array_equal(results.steps.number, whole.steps.number)
    np.testing.assert_array_equal(results.steps.stage, whole.steps.stage)
    np.testing.assert_array_equal(results.steps.factor, whole.steps.factor)
    np.testing.assert_array_equal(results.contact["joint"].mode, whole.contact["joint"].mode)
    names = ("opening", "slip", "traction_n", "traction_s")
    pairs = {name: [getattr(each.contact["joint"], name) for each in (results, whole)] for name in names}
    # What slips and opens is compared with displacements: an opening can vanish everywhere.
    scale = {"opening": "displacement", "slip": "displacement"}
    pairs["displacement"] = [results.displacement, whole.displacement]
    pairs["traction"] = [results.traction, whole.traction]
    pairs["reaction"] = [results.reactions["top"], whole.reactions["top"]]
    for name in ("external", "elastic", "dissipated"):
        pairs[name] = [getattr(each.energy, name) for each in (results, whole)]
    for name, (found, expected) in pairs.items():
        size = np.abs(pairs[scale.get(name, name)][1]).max()
        assert size > 0, name
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * size, err_msg=name)
    # Every step has its iterations once.
    assert sorted(set(results.convergence["step"])) == list(range(1, STEPS + 1))
    for number in range(1, STEPS + 1):
        rows = results.convergence[results.convergence["step"] == number]
        assert list(rows["iteration"]) == list(range(1, len(rows) + 1))


def test_the_history_has_friction_in_both_directions(whole: Results) -> None:
    joint = whole.contact["joint"]
    slipping = joint.mode == 1
    assert len(whole.steps) == STEPS
    assert 0 < slipping[4].sum() < joint.pairs, "some slip, some stick"
    assert (joint.mode[5] == 0).sum() > (joint.mode[4] == 0).sum(), "on reversal pairs stick first"
    assert joint.traction_s[4][slipping[4]].mean() * joint.traction_s[8][slipping[8]].mean() < 0
    assert np.all(np.diff(whole.energy.dissipated) >= -1e-15) and whole.energy.dissipated[-1] > 0


# In the midst of pressing, on reversal, between two stages, before anything is stored.
@pytest.mark.parametrize(
    ("how", "number", "before", "after"),
    [("kill", 2, 1, 2), ("kill", 6, 2, 1), ("fail", 10, 1, 3), ("kill", 1, 1, 2)],
)
def test_a_stopped_run_is_resumed_on_other_ranks(
    how: str, number: int, before: int, after: int, folder: Path, whole: Results, mpirun: Launch, mpirun_snippet: Launch
) -> None:
    stopped = mpirun_snippet(before, STOPPING, how, str(number), "run", "case.toml", "--quiet", cwd=folder)
    assert stopped.returncode == (3 if how == "fail" else 137), stopped.stderr
    results = open_results(folder / "case.h5")
    assert (results.status, len(results.steps)) == ("failed" if how == "fail" else "stopped", number - 1)
    done = mpirun(after, "run", "case.toml", "--resume", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert f"step {number} of {STEPS}" in done.stdout and f"step {number - 1} of {STEPS}" not in done.stdout
    results = open_results(folder / "case.h5")
    assert results.ranks == after
    expect_equal(results, whole)


def test_a_run_can_be_stopped_again_and_again(folder: Path, whole: Results, mpirun_snippet: Launch) -> None:
    for number, ranks in ((3, 1), (7, 2), (9, 1)):
        arguments = ("kill", str(number), "run", "case.toml", "--quiet", *(["--resume"] if number > 3 else []))
        assert mpirun_snippet(ranks, STOPPING, *arguments, cwd=folder).returncode == 137
        assert len(open_results(folder / "case.h5").steps) == number - 1
    expect_equal(pbem.run(folder / "case.toml", folder / "case.h5", resume=True), whole)


def test_a_finished_run_is_left_as_it_is(folder: Path, whole: Results, mpirun: Launch) -> None:
    shutil.copy(whole.path, folder / "case.h5")
    done = mpirun(2, "run", "case.toml", "--resume", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert f"finished: {STEPS} steps" in done.stdout
    assert not any(line.startswith("step ") for line in done.stdout.splitlines())
    expect_equal(open_results(folder / "case.h5"), whole)


def test_an_interrupt_keeps_the_steps_for_a_resumption(folder: Path, whole: Results) -> None:
    """Ctrl-C in the terminal of a run on one rank; sent by itself, as another process may be late."""
    # Jobs in the background of a shell ignore interrupts, and what they start does too.
    heeding = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
    process = subprocess.run(
        [sys.executable, "-c", heeding + STOPPING, "interrupt", "3", "run", "case.toml"],
        cwd=folder, env=make_environment(), capture_output=True, text=True, start_new_session=True, timeout=60,
    )  # fmt: skip
    error = process.stderr
    assert process.returncode == 130, error
    assert "Traceback" not in error and "--resume goes on" in error
    stopped = open_results(folder / "case.h5")
    assert stopped.status == "stopped" and 2 <= len(stopped.steps) <= 3
    expect_equal(pbem.run(folder / "case.toml", folder / "case.h5", resume=True), whole)
