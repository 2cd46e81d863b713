"""Custom laws that go wrong in the midst of a run end it on all ranks, with one message that names their file."""

from __future__ import annotations

import subprocess
from collections.abc import Mapping
from pathlib import Path

import h5py
import numpy as np
import pytest
from numpy.typing import NDArray

import pbem
from pbem.cli import main
from pbem.results.reader import open_results
from tests.cli.cli_sample import BLOCKS
from tests.parallel.launch import launch, launch_snippet
from tests.parallel.on_ranks import run_one_by_one

Done = subprocess.CompletedProcess[str]

CUSTOM = 'law = "custom"\nfile = "law.py"\nparameters = { friction = 0.2 }'
CASE = BLOCKS.replace('law = "coulomb"\nfriction = 0.2', CUSTOM)

LAW = """
import os, sys
import numpy as np
from pbem.contact.strength import Strength

calls = 0
rank = int(os.environ.get("OMPI_COMM_WORLD_RANK", 0))

def strength(p_n, slip, friction):
    global calls
    calls += 1
    CHANGE
    return Strength(-friction * p_n, -friction + 0 * p_n, 0 * p_n)
"""

WRONG = {
    "not finite": ("if calls > 3: p_n = p_n * np.nan", "law.py gives bound = nan"),
    "changed": ("if calls > 3: slip += 1e9", "law.py fails (ValueError: output array is read-only)"),
    "exits": ("if calls > 3: sys.exit(0)", "law.py fails (SystemExit: 0)"),
    "exits on one rank": ("if calls > 3 and rank == 1: sys.exit(0)", "law.py fails (SystemExit: 0)"),
    "ends the process": ("if calls > 3: os._exit(0)", "law.py fails (SystemExit: os._exit(0))"),
    "ends the process on one rank": (
        "if calls > 3 and rank == 1: os._exit(0)", "law.py fails (SystemExit: os._exit(0))",
    ),
    "another program": ("if calls > 3: os.execlp('true', 'true')", "law.py fails (SystemExit: os.execv"),
    "other shape": ("if calls > 3: friction = 0.2; p_n = p_n[:1]", "law.py gives a bound of shape (1,)"),
    "leaves on one rank": ("if calls > 3 and rank == 1: raise GeneratorExit", "law.py fails (GeneratorExit: )"),
    "other ranks": ("friction = friction * (1 + 0.1 * rank)", "law.py answers differently on different ranks"),
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A working directory with the case, whose law is right."""
    assert "law.py" in CASE
    (tmp_path / "case.toml").write_text(CASE)
    (tmp_path / "law.py").write_text(LAW.replace("CHANGE", "pass"))
    return tmp_path


def expect_wrong(done: subprocess.CompletedProcess[str], said: str, folder: Path) -> None:
    assert done.returncode == 1, done.stderr
    assert done.stderr.count(said) == 1 and "Traceback" not in done.stderr, done.stderr
    results = open_results(folder / "case.h5")
    assert results.status == "failed" and said in results.failure
    assert np.isfinite(results.traction).all()


def test_a_law_that_ends_the_process_ends_the_run(folder: Path) -> None:
    change, said = WRONG["ends the process"]
    (folder / "law.py").write_text(LAW.replace("CHANGE", change))
    expect_wrong(launch(1, "run", "case.toml", "--quiet", cwd=folder), said, folder)


# Laws by what they are, and the options of their runs.
ON_TWO_RANKS = {
    **{what: (LAW.replace("CHANGE", change), ()) for what, (change, _) in WRONG.items()},
    "file": (LAW.replace("CHANGE", "pass").replace("\ndef ", "\nassert rank == 0\ndef "), ()),
    "right": (LAW.replace("CHANGE", "pass"), ("--set", "solver.operator=hierarchical")),
    "no function": (LAW.replace("CHANGE", "friction = friction * (1 + 0.1 * calls)"), ()),
}


@pytest.fixture(scope="module")
def on_two_ranks(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, tuple[Path, Done]]:
    """Where laws have been run with on two ranks, and what has become of that; one launch for all, after each of which
    the ranks have to be fit for the next."""
    folder, commands = tmp_path_factory.mktemp("laws"), {}
    for number, (what, (law, options)) in enumerate(ON_TWO_RANKS.items()):
        (where := folder / str(number)).mkdir()
        (where / "case.toml").write_text(CASE)
        (where / "law.py").write_text(law)
        commands[what] = (where, ["run", "case.toml", "--quiet", *options])
    ended = run_one_by_one(launch_snippet, 2, commands, folder)
    return {what: (commands[what][0], done) for what, done in ended.items()}


@pytest.mark.parametrize("what", WRONG)
def test_a_law_that_goes_wrong_ends_all_ranks(what: str, on_two_ranks: Mapping[str, tuple[Path, Done]]) -> None:
    where, done = on_two_ranks[what]
    expect_wrong(done, WRONG[what][1], where)


def test_a_file_that_fails_on_one_rank_ends_all(on_two_ranks: Mapping[str, tuple[Path, Done]]) -> None:
    _, done = on_two_ranks["file"]
    assert done.returncode == 1, done.stderr
    said = "law.py fails (AssertionError: )"
    assert done.stderr.count(said) == 1 and "Traceback" not in done.stderr, done.stderr


def test_the_text_of_a_law_is_stored_and_compared(folder: Path) -> None:
    whole = pbem.run(folder / "case.toml", folder / "case.h5")
    assert np.isfinite(whole.traction).all()
    with pytest.raises(pbem.ResultFileError, match="another text of the law"):
        (folder / "law.py").write_text(LAW.replace("CHANGE", "pass  # changed"))
        pbem.run(folder / "case.toml", folder / "case.h5", resume=True)
    (folder / "law.py").write_text(LAW.replace("CHANGE", "pass"))
    again = pbem.run(folder / "case.toml", folder / "case.h5", resume=True)
    np.testing.assert_allclose(again.traction, whole.traction, rtol=0, atol=1e-12 * np.abs(whole.traction).max())
    coulomb = folder / "coulomb.toml"
    coulomb.write_text(BLOCKS)
    np.testing.assert_allclose(whole.traction, pbem.run(coulomb, folder / "coulomb.h5").traction, rtol=0, atol=1e-9)


def test_a_law_that_is_right_runs_on_two_ranks_with_the_hierarchical_operator(
    on_two_ranks: Mapping[str, tuple[Path, Done]]
) -> None:
    where, done = on_two_ranks["right"]
    assert done.returncode == 0, done.stderr
    assert open_results(where / "case.h5").status == "finished"


def read_broken(path: Path) -> NDArray[np.bool_]:
    with h5py.File(path) as file:
        return np.asarray(file["all/contact/broken"][()], dtype=bool)


def test_bonds_of_a_custom_law_fail_alike_on_two_ranks(tmp_path: Path) -> None:
    # The cascade and the pivoting ask the law on one rank alone.
    text = CASE.replace("friction = 0.2 }", "friction = 0.2, c = 1.3 }\ncohesion_lost = true\ntensile_strength = 0.5")
    strength = "Strength(np.maximum(c - friction * p_n, 0), np.where(c > friction * p_n, -friction, 0.0), 0 * p_n)"
    law = LAW.replace("friction):", "friction, c):").replace("CHANGE", f"return {strength}")
    (tmp_path / "case.toml").write_text(text)
    (tmp_path / "law.py").write_text(law)
    one = pbem.run(tmp_path / "case.toml", tmp_path / "one.h5")
    broken = read_broken(tmp_path / "one.h5")
    lost = broken.sum(axis=1)
    assert lost[0] < lost[-1], lost
    done = launch(2, "run", "case.toml", "-o", "two.h5", "--quiet", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    two = open_results(tmp_path / "two.h5")
    np.testing.assert_array_equal(read_broken(tmp_path / "two.h5"), broken)
    np.testing.assert_allclose(two.traction, one.traction, rtol=0, atol=1e-9 * np.abs(one.traction).max())


@pytest.mark.parametrize(("change", "said", "ranks"), [
    ("", "bound = 0.00022, then 0.00024", 2),
    ("friction = friction * (1 + 0.1 * calls * (slip > 1e-3))", "bound = 0.00022, then 0.00024", 1),
    ("friction = friction * (1 + 0.1 * calls * (p_n < -10))", "bound = 220, then 240", 1),
])  # fmt: skip
def test_a_law_that_is_no_function_of_its_arguments_is_a_fault(
    change: str, said: str, ranks: int, folder: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str], on_two_ranks: Mapping[str, tuple[Path, Done]],
) -> None:  # fmt: skip
    """Its search ended as "mode cycle", with the advice to take shorter elements."""
    if ranks == 1:
        (folder / "law.py").write_text(LAW.replace("CHANGE", change))
        monkeypatch.chdir(folder)
        code, told = main(["run", "case.toml", "--quiet"]), capsys.readouterr().err
    else:
        folder, done = on_two_ranks["no function"]
        code, told = done.returncode, done.stderr
    assert code == 2, told
    assert told.count(f"the law law.py answers differently when it is asked again: {said}") == 1, told
    assert "interfaces.joint.file" in told and not (folder / "case.h5").exists()


def test_a_law_that_fails_far_from_what_it_is_made_for_is_none(folder: Path) -> None:
    change = "if p_n.min() < -500 or slip.max() > 0.5: raise ValueError('too much')"
    (folder / "law.py").write_text(LAW.replace("CHANGE", change))
    assert pbem.run(folder / "case.toml", folder / "case.h5").status == "finished"
