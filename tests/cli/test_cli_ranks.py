"""The command line under a launcher: the first rank speaks, all ranks end alike."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np

from pbem.results.reader import open_results
from tests.cli.cli_sample import BLOCKS

Launch = Callable[..., subprocess.CompletedProcess[str]]


def test_two_ranks_write_one_file_and_one_log(tmp_path: Path, mpirun: Launch) -> None:
    (tmp_path / "blocks.toml").write_text(BLOCKS)
    done = mpirun(2, "run", "blocks.toml", "-o", "two.h5", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("step 3 of 3") == done.stdout.count("finished: 3 steps") == 1
    assert mpirun(1, "blocks.toml", "-o", "one.h5", "--quiet", cwd=tmp_path).returncode == 0
    one, two = open_results(tmp_path / "one.h5"), open_results(tmp_path / "two.h5")
    assert (one.ranks, two.ranks) == (1, 2)
    np.testing.assert_allclose(two.displacement, one.displacement, atol=1e-12)
    np.testing.assert_array_equal(two.contact["joint"].mode, one.contact["joint"].mode)


def test_a_wrong_case_is_refused_once(tmp_path: Path, mpirun: Launch) -> None:
    (tmp_path / "wrong.toml").write_text(BLOCKS.replace("poisson = 0.3", "poisson = 0.7"))
    done = mpirun(2, "run", "wrong.toml", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.count("materials.soft.poisson") == 1
    assert "Traceback" not in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["wrong.toml"]


def test_a_wrong_command_line_is_refused_once(tmp_path: Path, mpirun: Launch) -> None:
    (tmp_path / "blocks.toml").write_text(BLOCKS)
    for arguments, said in ((["run", "--bogus"], "usage"), (["run", "nothing"], "which is no file"),
                            (["blocks.toml", "-o", "none/a.h5"], "does not exist")):
        done = mpirun(2, *arguments, cwd=tmp_path)
        assert done.returncode == 2
        assert done.stderr.count(said) == 1
        assert "Traceback" not in done.stderr


def test_other_commands_are_done_by_the_first_rank(tmp_path: Path, mpirun: Launch) -> None:
    (tmp_path / "blocks.toml").write_text(BLOCKS)
    done = mpirun(2, "check", "blocks.toml", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("Small blocks") == 1
