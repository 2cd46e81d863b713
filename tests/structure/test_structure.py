"""The package obeys its rules of structure; each rule is also seen to fail, on a small tree that breaks it."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

import pbem
from tests.structure import checks, kinds
from tests.structure.checks import Module

# Whoever only reads cases and results waits for no MPI, and needs none.
WITH_MPI = ("parallel", "solve", "pass_file", "storing", "driver", "sweeps", "__main__")


@pytest.fixture(scope="module")
def modules() -> dict[str, Module]:
    """The sources of the package, which are read where they are looked at: every process collects this file."""
    return checks.read_modules(Path(pbem.__file__).parent)


def check_order(modules: dict[str, Module]) -> list[str]:
    """Imports go along the order of the parts, in all modules."""
    return [fault for module in modules.values() for fault in checks.check_order(module, modules)]


def of_each(check: Callable[[Module], list[str]]) -> Check:
    """The check of a single module as one of all of them."""
    return lambda modules: [fault for module in modules.values() for fault in check(module)]


Check = Callable[[dict[str, Module]], list[str]]
CHECKS: dict[str, Check] = {
    "imports go along the path of the data": check_order,
    "no cycle of imports": checks.check_cycles,
    "libraries come in by their own part": of_each(checks.check_doors),
    "nobody asks which system of equations it is": of_each(checks.check_questions),
    "names say one thing": of_each(checks.check_names),
    "docstrings are there": of_each(checks.check_docstrings),
    "modules are short": of_each(checks.check_length),
    "only the protocol asks for an element's kind": of_each(kinds.check_kinds),
}


def test_all_parts_are_read(modules: dict[str, Module]) -> None:
    # Else the tests below could pass because they look at nothing.
    assert {"pbem", "pbem.errors", "pbem.model.model", "pbem.mesh.mesh", "pbem.solve.problem.step"} <= modules.keys()


@pytest.mark.parametrize("check", CHECKS.values(), ids=CHECKS.keys())
def test_the_package_obeys(check: Check, modules: dict[str, Module]) -> None:
    faults = check(modules)
    assert not faults, "\n".join(faults)


def test_the_kinds_of_systems_are_there(modules: dict[str, Module]) -> None:
    defined = {node.name for module in modules.values() for node in module.nodes if isinstance(node, ast.ClassDef)}
    assert set(checks.KINDS) | checks.MAKERS.keys() <= defined
    assert {maker for makers in checks.MAKERS.values() for maker in makers} <= modules.keys()


def test_who_may_ask_for_a_kind_is_there_and_few(modules: dict[str, Module]) -> None:
    # 36 modules did before there was a protocol.
    assert modules.keys() >= kinds.MAY_ASK and len(kinds.MAY_ASK) <= 8


# A model is made by calls as well as from a file: up to the mechanics nothing knows of files or processes.
KNOW_NO_FILES = ("geometry", "description", "model", "mesh", "bem", "contact")


@pytest.mark.parametrize(("asked", "banned"), [
    (lambda part: part not in WITH_MPI, ("mpi4py", "petsc4py")),
    (lambda part: part in KNOW_NO_FILES, ("mpi4py", "petsc4py", "h5py", "tomllib", "pbem.case")),
], ids=["no MPI", "no files"])  # fmt: skip
def test_what_is_loaded_on_the_way(
    asked: Callable[[str], bool], banned: tuple[str, ...], modules: dict[str, Module]
) -> None:
    names = [name for name, module in modules.items() if asked(module.part)]
    code = f"""
import importlib, sys
for name in sys.argv[1:]:
    importlib.import_module(name)
    for library in {banned}:
        if library in sys.modules:
            sys.exit(f"{{name}} loads {{library}}")
"""
    run = subprocess.run([sys.executable, "-c", code, *names], capture_output=True, text=True, timeout=60)
    assert run.returncode == 0, run.stderr


def make_tree(folder: Path, sources: dict[str, str]) -> dict[str, Module]:
    """Write a small package named pbem; `sources` is by path in it."""
    for name, text in sources.items():
        path = folder / "pbem" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return checks.read_modules(folder / "pbem")


# A tree that is in order, importing in all the ways that are allowed.
SOUND = {
    "__init__.py": '"""The package."""',
    "errors.py": '"""Errors."""',
    "parallel.py": '"""Parallel."""\nfrom mpi4py import MPI',
    "geometry/__init__.py": '"""Geometry."""\nfrom pbem.geometry.curve import draw',
    "geometry/curve.py": '"""Curve."""\nfrom ..errors import Fault\ndef draw():\n    """Draw."""',
    "mesh/__init__.py": '"""Meshes."""',
    "mesh/mesh.py": '"""Mesh."""\nfrom pbem.geometry import draw\nimport pbem.errors\nmusic = 1',
    "case/__init__.py": '"""Cases."""',
    "case/reader.py": '"""Reader."""\nimport tomllib\nfrom pbem.mesh import mesh\ndef read():\n    """Read."""',
    "solve/__init__.py": '"""Solving."""\nfrom . import newton',
    "solve/newton.py": '"""Newton."""\nfrom petsc4py import PETSc\nfrom pbem.mesh import mesh\nimport pbem.parallel',
    "cli.py": '"""Command line."""\ndef main():\n    """Run."""\n    from pbem.solve.nonlinear.newton import mesh',
}


def list_faults(modules: dict[str, Module]) -> list[str]:
    """Apply all checks to all modules."""
    return [fault for check in CHECKS.values() for fault in check(modules)]


def test_a_sound_tree_has_no_fault(tmp_path: Path) -> None:
    assert list_faults(make_tree(tmp_path, SOUND)) == []


BREACHES = {
    "upwards": ("geometry/curve.py", "import pbem.mesh.mesh", "geometry may not import pbem.mesh.mesh"),
    "upwards, relative": ("geometry/curve.py", "from ..mesh.mesh import a", "geometry may not import pbem.mesh.mesh"),
    "upwards, module of a folder": ("geometry/curve.py", "from ..mesh import mesh", "may not import pbem.mesh.mesh"),
    "upwards, folder": ("geometry/curve.py", "from pbem.mesh import Mesh", "geometry may not import pbem.mesh"),
    "a reader": ("mesh/mesh.py", "from pbem.case.reader import read", "mesh may not import pbem.case.reader"),
    "upwards, in a function": ("mesh/mesh.py", "def _f():\n    import pbem.cli", "mesh may not import pbem.cli"),
    "upwards, from a package": ("mesh/__init__.py", "from .. import cli", "mesh may not import pbem.cli"),
    "base imports a part": ("errors.py", "from pbem.mesh import mesh", "errors may not import pbem.mesh.mesh"),
    "mechanics is parallel": ("mesh/mesh.py", "import pbem.parallel", "mesh may not import pbem.parallel"),
    "unknown part": ("extra.py", "", "part 'extra' has no place in the order"),
    "cycle": ("geometry/curve.py", "from . import draw", "cycle of imports: pbem.geometry"),
    "petsc4py": ("mesh/mesh.py", "import petsc4py.PETSc", "petsc4py.PETSc may be imported in solve only"),
    "mpi4py": ("cli.py", "from mpi4py import MPI", "mpi4py.MPI may be imported in parallel and solve only"),
    "h5py": ("cli.py", "import h5py", "h5py may be imported in results only"),
    "tomllib": ("mesh/mesh.py", "import tomllib", "tomllib may be imported in case only"),
    "matplotlib": ("cli.py", "import matplotlib.pyplot as plt", "matplotlib.pyplot may be imported in results only"),
    "question": ("mesh/mesh.py", "isinstance(music, HierarchicalOperator)", "asks for HierarchicalOperator"),
    "question, several": ("mesh/mesh.py", "isinstance(music, int | a.KrylovTangent)", "asks for KrylovTangent"),
    "question, attribute": ("mesh/mesh.py", "getattr(music.tangent, 'nearby', False)", "asks what music.tangent has"),
    "question, type": ("mesh/mesh.py", "type(music) is a.RowOperator", "compares types"),
    "maker": ("solve/newton.py", "from pbem.solve.tangent.krylov import KrylovTangent", "KrylovTangent is made in"),
    "name, variable": ("mesh/mesh.py", "mu = 0.5", "'mu' means several things"),
    "name, parameter": ("mesh/mesh.py", "def _f(mu): ...", "'mu' means several things"),
    "name, keyword": ("mesh/mesh.py", "_f(mu=1)", "'mu' means several things"),
    "name, attribute": ("mesh/mesh.py", "_f.mu", "'mu' means several things"),
    "name, import": ("mesh/mesh.py", "import numpy as mu", "'mu' means several things"),
    "vague module": ("mesh/io_utils.py", "", "pbem.mesh.io_utils does not say what it is"),
    "vague class": ("mesh/mesh.py", "class _MeshManager: ...", "_MeshManager does not say what it is"),
    "vague function": ("mesh/mesh.py", "def _helper(): ...", "_helper does not say what it is"),
    "undocumented function": ("mesh/mesh.py", "def make(): ...", "make has no docstring"),
    "undocumented class": ("mesh/mesh.py", "class Mesh: ...", "Mesh has no docstring"),
    "kind, compared": ("mesh/mesh.py", "_f = mesh.sweep == 0", "asks for an element's kind"),
    "kind, chosen": ("mesh/mesh.py", "def _f(sweep):\n    return 1 if sweep[0] else 2", "asks for an element's kind"),
    "kind, any": ("mesh/mesh.py", "_f = mesh.sweep[own].any()", "asks for an element's kind"),
    "kind, map of an arc": ("mesh/mesh.py", "_f = np.tan(0.25 * one.sweep)", "asks for an element's kind"),
    "kind, backwards": ("mesh/mesh.py", "_f = np.concatenate([mesh.sweep, -mesh.sweep])", "asks for an element's kind"),
    "kind, center": ("mesh/mesh.py", "_f = 0 if leg.center is None else 1", "asks for an element's kind"),
    "long module": ("mesh/mesh.py", "\n" * 400, "402 lines, more than 400"),
}


@pytest.mark.parametrize("breach", BREACHES)
def test_a_breach_is_found(breach: str, tmp_path: Path) -> None:
    file, code, expected = BREACHES[breach]
    text = SOUND.get(file, '"""Another module."""').replace("from pbem.geometry import draw\nimport pbem.errors\n", "")
    faults = list_faults(make_tree(tmp_path, SOUND | {file: f"{text}\n{code}"}))
    assert any(expected in fault for fault in faults), faults
    assert all(file in fault or "cycle" in fault for fault in faults), faults


def test_a_missing_module_docstring_is_found(tmp_path: Path) -> None:
    faults = list_faults(make_tree(tmp_path, SOUND | {"mesh/mesh.py": "size = 1"}))
    assert faults == [f"{tmp_path}/pbem/mesh/mesh.py:1: the module has no docstring"]
