"""What `import pbem` offers by itself, and what it waits with until it is asked for."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tarfile
from pathlib import Path

import pytest

import pbem
from pbem import errors
from pbem.driver import run
from pbem.results.reader import open_results


def test_the_package_offers_runs_and_results() -> None:
    assert pbem.run is run
    assert pbem.open_results is open_results
    assert {"run", "open_results", "CaseError", "__version__"} <= set(dir(pbem))


def test_every_kind_of_error_is_offered() -> None:
    kinds = {kind.__name__ for kind in errors.PbemError.__subclasses__()} | {"PbemError"}
    assert kinds <= set(pbem.__all__) and kinds <= set(dir(pbem))


def test_what_the_package_does_not_offer_is_named() -> None:
    with pytest.raises(AttributeError, match="'pbem' has no attribute 'solve_everything'"):
        pbem.solve_everything  # noqa: B018


def test_importing_the_package_loads_no_library() -> None:
    code = """
import sys
import pbem
sys.exit(" ".join({"numpy", "h5py", "mpi4py", "petsc4py", "pydantic"} & set(sys.modules)) or 0)
"""
    process = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert process.returncode == 0, process.stderr


@pytest.mark.parametrize("before", ["gc.enable()", "gc.disable()"])
def test_what_computes_is_loaded_without_collecting_and_leaves_the_collector_as_it_was(before: str) -> None:
    code = f"""
import gc, sys
import pbem
{before}
was, found = gc.isenabled(), []
gc.callbacks.append(lambda phase, info: found.append(info))
pbem.run
sys.exit(0 if gc.isenabled() == was and len(found) <= 2 else f"{{gc.isenabled()}}, {{len(found)}} collections")
"""
    process = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert process.returncode == 0, process.stderr


def test_a_run_with_a_dense_operator_does_not_load_what_the_other_needs(tmp_path: Path) -> None:
    code = """
import sys
import pbem
pbem.run("two_blocks")
not_needed = {"scipy.optimize", "pbem.bem.hierarchical", "pbem.solve.system.hierarchical", "pbem.results.evaluation"}
sys.exit(" ".join(not_needed & set(sys.modules)) or 0)
"""
    process = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, cwd=tmp_path)
    assert process.returncode == 0, process.stderr


def test_a_source_package_has_all_that_the_kernels_and_commands_need(tmp_path: Path) -> None:
    root, made = Path(__file__).resolve().parents[2], tmp_path / "copy"
    for folder in ("pbem", "cases"):
        shutil.copytree(root / folder, made / folder, ignore=shutil.ignore_patterns("__pycache__", "*.so"))
    for name in ("setup.py", "pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(root / name, made)
    command = [sys.executable, "setup.py", "-q", "sdist", "--formats=tar", "-d", str(tmp_path)]
    process = subprocess.run(command, cwd=made, capture_output=True, text=True, timeout=120)
    assert process.returncode == 0, process.stderr
    with tarfile.open(next(tmp_path.glob("*.tar"))) as package:
        packed = {name.partition("/")[2] for name in package.getnames()}
    needed = {str(path.relative_to(made)) for pattern in ("pbem/**/*.py", "pbem/bem/*.[ch]", "pbem/pages/*.md",
              "cases/*.toml") for path in made.glob(pattern)}  # fmt: skip
    assert len(needed) > 200
    assert sorted(needed - packed) == []


def test_errors_are_found_by_their_module_too() -> None:
    code = "import pbem; assert pbem.errors.CaseError is pbem.CaseError"
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)
