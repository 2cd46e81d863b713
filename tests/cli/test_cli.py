"""The command line as a user meets it: texts, files and exit codes."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import get_args

import h5py
import numpy as np
import pytest

import pbem
from pbem import bundled
from pbem.bundled import find_case, list_bundled_cases
from pbem.cli import main, split_petsc_options
from pbem.description.schema import SolverTable
from pbem.errors import CaseError, ConvergenceError
from pbem.model.model import Operator
from pbem.results.reader import open_results
from pbem.run_command import OPERATORS
from tests.cli.cli_sample import BLOCKS

Capture = pytest.CaptureFixture[str]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A working directory with the case blocks.toml, outside of any launcher."""
    for name in ("OMPI_COMM_WORLD_RANK", "PMI_RANK", "SLURM_PROCID"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "blocks.toml").write_text(BLOCKS)
    yield tmp_path


@pytest.fixture
def computed(folder: Path, capsys: Capture) -> Path:
    """The result file of the case."""
    assert main(["run", "blocks.toml", "--quiet"]) == 0
    capsys.readouterr()
    return folder / "blocks.h5"


def test_a_case_is_run_into_a_file_beside_the_user(folder: Path, capsys: Capture) -> None:
    assert main(["blocks.toml"]) == 0
    results = open_results("blocks.h5")
    assert (results.title, results.status, len(results.steps)) == ("Small blocks", "finished", 3)
    assert results.case == BLOCKS
    out, err = capsys.readouterr()
    assert "step 3 of 3, stage shear, factor 0.5 to 1" in out
    assert "finished: 3 steps" in out and out.rstrip().endswith("results: blocks.h5")
    assert err == ""


def test_reactions_balance_and_friction_limits_them(computed: Path) -> None:
    reactions = open_results(computed).reactions
    np.testing.assert_allclose(reactions["top"] + reactions["bottom"], 0, atol=1e-8)
    assert abs(reactions["top"][-1, 0] / reactions["top"][-1, 1]) == pytest.approx(0.2, rel=0.01)


def test_quiet_runs_say_nothing(folder: Path, capsys: Capture) -> None:
    assert main(["run", "blocks.toml", "-o", "other.h5", "--quiet"]) == 0
    assert (folder / "other.h5").is_file() and not (folder / "blocks.h5").exists()
    assert capsys.readouterr() == ("", "")


def test_the_operator_can_be_chosen_on_the_command_line(folder: Path, capsys: Capture) -> None:
    for name in ("dense", "hierarchical"):
        assert main(["run", "blocks.toml", "--operator", name, "-o", f"{name}.h5"]) == 0
        assert ("hierarchical operator:" in capsys.readouterr().out) == (name == "hierarchical")
        with h5py.File(f"{name}.h5", "r") as file:
            assert json.loads(file.attrs["configuration"])["solver"]["operator"] == name
        assert open_results(f"{name}.h5").case == BLOCKS
    dense, hierarchical = open_results("dense.h5"), open_results("hierarchical.h5")
    scale = np.abs(dense.traction).max()
    np.testing.assert_allclose(hierarchical.traction, dense.traction, rtol=0, atol=1e-7 * scale)
    np.testing.assert_array_equal(hierarchical.contact["joint"].mode, dense.contact["joint"].mode)
    # Going on with another operator is the user's choice as well.
    assert main(["run", "blocks.toml", "--operator", "dense", "-o", "hierarchical.h5", "--resume", "--quiet"]) == 0


def test_operators_are_those_of_case_files(folder: Path, capsys: Capture) -> None:
    annotation = SolverTable.model_fields["operator"].annotation
    assert OPERATORS == get_args(annotation) == get_args(Operator)
    assert main(["run", "blocks.toml", "--operator", "sparse"]) == 2
    assert "invalid choice: 'sparse'" in capsys.readouterr().err
    with pytest.raises(ValueError, match="'sparse'; expected one of auto, dense, hierarchical"):
        pbem.run("blocks.toml", operator="sparse")  # type: ignore[arg-type]
    assert [path.name for path in folder.iterdir()] == ["blocks.toml"]


def test_resuming_a_cut_run_gives_what_a_whole_run_gives(computed: Path, capsys: Capture) -> None:
    import h5py

    whole = open_results(computed)
    shutil.copy(computed, "cut.h5")
    with h5py.File("cut.h5", "r+") as cut:
        for name in ("stage", "factor", "iterations", "residual", "number"):
            cut["steps"][name].resize(2, axis=0)
    assert main(["run", "blocks.toml", "-o", "cut.h5", "--resume"]) == 0
    assert "step 3 of 3" in capsys.readouterr().out
    resumed = open_results("cut.h5")
    np.testing.assert_allclose(resumed.displacement, whole.displacement, atol=1e-14)
    np.testing.assert_allclose(resumed.contact["joint"].slip, whole.contact["joint"].slip, atol=1e-14)
    np.testing.assert_array_equal(resumed.convergence["step"], whole.convergence["step"])


def test_a_wrong_case_is_refused_with_all_its_faults(folder: Path, capsys: Capture) -> None:
    wrong = BLOCKS.replace("friction = 0.2", "frction = 0.2").replace("poisson = 0.3", "poisson = 0.7")
    (folder / "wrong.toml").write_text(wrong)
    for command in (["check", "wrong.toml"], ["run", "wrong.toml"], ["wrong.toml", "--resume"]):
        assert main(command) == 2
        out, err = capsys.readouterr()
        assert out == ""
        assert "2 faults" in err and "poisson" in err and "frction" in err
        assert err.count("materials.soft.poisson") == 1
        assert "Traceback" not in err
    assert sorted(path.name for path in folder.iterdir()) == ["blocks.toml", "wrong.toml"]


@pytest.mark.parametrize(
    "arguments, said",
    [
        (["run"], "CASE"),
        ([], "COMMAND"),
        (["run", "blocks.toml", "--bogus"], "--bogus"),
        (["chek", "blocks.toml"], "invalid choice: 'chek'"),
        (["run", "blocks.toml", "-o", "none/a.h5"], "the folder none does not exist"),
        (["run", "blocks.toml", "--resume", "--quiet"], "no such file to resume"),
        (["info", "none.h5"], "none.h5: no such file"),
        (["info", "blocks.toml"], "is not an HDF5 file"),
        (["plot", "blocks.toml"], "is not an HDF5 file"),
        (["check", "blocks.toml", "--plot", "a.txt"], "is no picture"),
        (["check", "blocks.toml", "--plot", "none/a.png"], "the folder none does not exist"),
        (["check", "blocks.toml", "-pbem_ksp_view"], "PETSc options"),
    ],
)
def test_a_wrong_command_line_is_refused(folder: Path, capsys: Capture, arguments: list[str], said: str) -> None:
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert said in err
    assert "Traceback" not in err
    assert [path.name for path in folder.iterdir()] == ["blocks.toml"]


def test_check_tells_what_would_be_computed(folder: Path, capsys: Capture) -> None:
    assert main(["check", "blocks.toml", "--plot", "model.png"]) == 0
    out = capsys.readouterr().out
    for text in ("Small blocks", "region lower", "friction 0.2", "shear: 2 steps", "unknowns", "picture: model.png"):
        assert text in out
    assert (folder / "model.png").stat().st_size > 5000
    assert not (folder / "blocks.h5").exists()


def test_info_and_plot_read_a_result_file(computed: Path, capsys: Capture) -> None:
    assert main(["info", "blocks.h5"]) == 0
    assert "steps stored: 3" in capsys.readouterr().out
    assert main(["plot", "blocks.h5"]) == 0
    assert (computed.with_suffix(".png")).stat().st_size > 5000
    assert main(["plot", "blocks.h5", "-o", "step2.pdf", "--step", "2", "--magnify", "10"]) == 0
    assert (computed.parent / "step2.pdf").stat().st_size > 5000
    capsys.readouterr()
    assert main(["plot", "blocks.h5", "--step", "7"]) == 2
    assert "holds no load step 7; it holds: 1, 2, 3" in capsys.readouterr().err
    for scale in ("nan", "inf", "ten"):
        assert main(["plot", "blocks.h5", "--magnify", scale]) == 2
        assert scale in capsys.readouterr().err


def test_help_and_version(capsys: Capture) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.startswith("pbem 0.")
    assert main(["--help"]) == 0
    text = capsys.readouterr().out
    assert all(f"pbem {command}" in text for command in ("check", "run", "info", "plot"))
    assert main(["run", "--help"]) == 0
    text = capsys.readouterr().out
    assert "-pbem_ksp_rtol" in text and "exit code" in text


def break_run(monkeypatch: pytest.MonkeyPatch, error: BaseException) -> None:
    """Let a run end by this exception after its first step."""
    import pbem.driver

    whole = pbem.driver.march

    def march(*arguments: object, **options: object) -> Iterator[object]:
        yield next(whole(*arguments, **options))  # type: ignore[arg-type]
        raise error

    monkeypatch.setattr(pbem.driver, "march", march)


def test_a_run_that_does_not_converge_keeps_its_steps(
    folder: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    break_run(monkeypatch, ConvergenceError("mode cycle", "joint near (1, 1); try more steps"))
    assert main(["blocks.toml"]) == 3
    err = capsys.readouterr().err
    assert "joint near (1, 1); try more steps" in err and "blocks.h5 holds every step reached" in err
    assert "Traceback" not in err
    results = open_results("blocks.h5")
    assert (results.status, len(results.steps)) == ("failed", 1)
    assert "mode cycle" in results.failure


def test_an_unexpected_error_shows_one_traceback(
    folder: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    break_run(monkeypatch, ZeroDivisionError("a slip of ours"))
    assert main(["blocks.toml"]) == 1
    err = capsys.readouterr().err
    assert err.count("Traceback") == err.count("ZeroDivisionError: a slip of ours") == 1
    assert open_results("blocks.h5").status == "failed"


# The program, interrupted once, while it imports the module of argument 1.
INTERRUPTED_AT_ITS_START = """
import runpy, sys
left = [sys.argv.pop(1)]

class Interrupting:
    def find_spec(self, name, path, target=None):
        if name in left:
            left.remove(name)
            raise KeyboardInterrupt

sys.meta_path.insert(0, Interrupting())
runpy.run_module("pbem", run_name="__main__", alter_sys=True)
"""


@pytest.mark.parametrize(("module", "rank", "said"), [
    ("argparse", 0, "pbem: interrupted\n"), ("pbem.errors", 0, "pbem: interrupted\n"), ("pbem.wording", 1, ""),
])
def test_interrupting_the_start_is_said_in_a_line(module: str, rank: int, said: str, folder: Path) -> None:
    """By the first rank, also before the command line has been imported."""
    command = [sys.executable, "-c", INTERRUPTED_AT_ITS_START, module, "run", "blocks.toml"]
    environment = os.environ | {"OMPI_COMM_WORLD_RANK": str(rank), "OMPI_COMM_WORLD_SIZE": "2"}
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", said)


def test_the_command_is_the_process_of_the_package() -> None:
    root, target = Path(__file__).parents[2], "pbem.__main__:main"
    assert tomllib.loads((root / "pyproject.toml").read_text())["project"]["scripts"] == {"pbem": target}
    assert f"- pbem = {target}\n" in (root / "scripts" / "packaging" / "recipe.yaml").read_text()


def test_interrupting_a_run_is_said_in_a_line(folder: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch) -> None:
    break_run(monkeypatch, KeyboardInterrupt())
    assert main(["blocks.toml"]) == 130
    err = capsys.readouterr().err
    assert "interrupted" in err and "--resume" in err and "Traceback" not in err
    assert main(["blocks.toml", "--quiet", "--force"]) == 130
    stopped = open_results("blocks.h5")
    assert stopped.status == "stopped" and stopped.failure.startswith("interrupted")


def run_into_closed_pipe(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Run the program with a standard output whose reader has gone."""
    reader, writer = os.pipe()
    os.close(reader)
    try:
        return subprocess.run(
            [sys.executable, "-m", "pbem", *arguments], stdout=writer, stderr=subprocess.PIPE, text=True
        )
    finally:
        os.close(writer)


@pytest.mark.parametrize("words", [
    ["run", "blocks.toml", "--force", "-o", ""], ["run", "blocks.toml", "--force", "--profile="],
    ["export", "blocks.h5", "-o", ""], ["plot", "blocks.h5", "--output="], ["check", "blocks.toml", "--plot", ""],
    ["sweep", "blocks.toml", "--set", "interfaces.joint.friction=0.1,0.2", "-o", ""],
    ["make", "cracks", "--count", "3", "-o", ""],
])  # fmt: skip
def test_empty_names_of_files_are_refused(words: list[str], computed: Path, capsys: Capture) -> None:
    before = computed.read_bytes()
    assert main(words) == 2
    assert "found an empty name; expected the name of a file" in capsys.readouterr().err
    assert computed.read_bytes() == before
    assert sorted(os.listdir()) == ["blocks.h5", "blocks.toml"]


def test_a_run_whose_reader_has_gone_is_not_finished(folder: Path) -> None:
    done = run_into_closed_pipe("run", "blocks.toml")
    assert done.returncode == 1, done.stderr
    assert done.stderr.startswith("pbem: nobody reads the progress any more") and done.stderr.count("\n") == 1


def test_a_reader_that_has_gone_is_no_fault_of_other_commands(folder: Path) -> None:
    done = run_into_closed_pipe("check", "blocks.toml")
    assert (done.returncode, done.stderr) == (0, "")


def test_petsc_options_are_taken_out_with_their_values() -> None:
    arguments = ["-pbem_ksp_rtol", "1e-8", "run", "-pbem_ksp_view", "-o", "a.h5", "-pbem_shift", "-0.5",
                 "-pbem_mat_mumps_icntl_14=40", "-pbem_ksp_monitor", "case.toml"]
    petsc, plain = split_petsc_options(arguments)
    assert petsc == {"ksp_rtol": "1e-8", "ksp_view": "", "shift": "-0.5", "mat_mumps_icntl_14": "40", "ksp_monitor": ""}
    assert plain == ["run", "-o", "a.h5", "case.toml"]


def test_petsc_options_reach_the_run(folder: Path, capsys: Capture) -> None:
    import h5py

    assert main(["run", "blocks.toml", "--quiet", "-pbem_ksp_rtol", "1e-11"]) == 0
    with h5py.File("blocks.h5") as file:
        assert "ksp_rtol" in file.attrs["petsc_options"] and "1e-11" in file.attrs["petsc_options"]


def test_cases_of_the_program_are_found_by_name(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cases = list_bundled_cases()
    assert "two_blocks" in cases and all(path.is_file() for path in cases.values())
    assert find_case("two_blocks") == find_case("two_blocks.toml") == cases["two_blocks"]
    assert find_case("blocks.toml") == Path("blocks.toml")
    with pytest.raises(CaseError, match=r"two_blocks.*did you mean 'two_blocks'\?"):
        find_case("two_bocks")
    # What lies in the working directory goes before what comes with the program.
    (folder / "two_blocks").write_text(BLOCKS)
    assert find_case("two_blocks") == Path("two_blocks")
    monkeypatch.setattr(bundled, "list_bundled_cases", dict)
    with pytest.raises(CaseError, match=r"expected a case file$"):
        find_case("two_bocks")


@pytest.mark.parametrize("command", ["check blocks.toml", "info blocks.h5", "plot blocks.h5", "--help"])
def test_only_run_needs_mpi_and_petsc(computed: Path, command: str) -> None:
    code = ("import sys; from pbem.cli import main; code = main(sys.argv[1:]); "
            "print([name for name in ('mpi4py', 'petsc4py', 'mpi4py.MPI') if name in sys.modules]); sys.exit(code)")
    arguments = [sys.executable, "-c", code, *command.split()]
    done = subprocess.run(arguments, capture_output=True, text=True, cwd=computed.parent)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "[]"


def test_further_ranks_leave_all_but_runs_to_the_first(folder: Path) -> None:
    environment = os.environ | {"OMPI_COMM_WORLD_RANK": "1", "OMPI_COMM_WORLD_SIZE": "2"}
    arguments = [sys.executable, "-m", "pbem", "check", "blocks.toml", "--plot", "model.png"]
    done = subprocess.run(arguments, capture_output=True, text=True, env=environment)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert not (folder / "model.png").exists()


def test_further_ranks_do_not_repeat_what_is_wrong_with_the_command_line(folder: Path) -> None:
    environment = os.environ | {"OMPI_COMM_WORLD_RANK": "1", "OMPI_COMM_WORLD_SIZE": "2"}
    arguments = [sys.executable, "-m", "pbem", "check", "blocks.toml", "-pbem_ksp_view"]
    done = subprocess.run(arguments, capture_output=True, text=True, env=environment)
    assert (done.returncode, done.stdout, done.stderr) == (2, "", "")


def test_the_package_can_be_run_as_a_module(folder: Path) -> None:
    done = subprocess.run([sys.executable, "-m", "pbem", "info", "none.h5"], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (2, "", "pbem: none.h5: no such file\n")


@pytest.mark.parametrize("command", ["check", "run", "info", "plot", "export", "import"])
def test_a_name_that_no_file_can_have_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    monkeypatch.chdir(tmp_path)
    more = ["-o", "made.toml"] if command == "import" else []
    assert main([command, "a" * 3000 + ".csv", *more]) == 2
    said = capsys.readouterr().err
    assert ("Traceback" not in said and "no such file" in said) or "which is no file" in said
    assert not list(tmp_path.iterdir())
