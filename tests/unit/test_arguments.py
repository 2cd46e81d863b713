"""Arguments of the functions of `import pbem` that fit nowhere: the error names the argument and what is expected."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pbem
from pbem.results.reader import Results, open_results
from pbem.results.writer import ResultWriter
from tests.unit.case_sample import BLOCKS
from tests.unit.results_sample import make_mesh, make_model, make_steps

MODEL = make_model()
MESH = make_mesh(MODEL)
ODD = [np.array(["slip", "opening"]), np.zeros((0, 2)), ["slip"], slice(None), object()]


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Results:
    path = tmp_path_factory.mktemp("odd") / "a.h5"
    with ResultWriter(path, MODEL, MESH, 1, "") as writer:
        for step in make_steps(MODEL, MESH)[:2]:
            writer.append(step)
    return open_results(path)


@pytest.mark.parametrize("odd", ODD, ids=lambda each: type(each).__name__)
def test_results_refuse_what_names_nothing(results: Results, odd: Any) -> None:
    with pytest.raises(ValueError, match=r"found .*; expected one of: opening, slip, traction_n, traction_s"):
        results.contact["joint"].integrate(odd)
    with pytest.raises(ValueError, match=r"number: found .*; expected the number of a load step"):
        results.find_step(odd)
    with pytest.raises(KeyError, match="expected the name of an interface, crack or contact"):
        results.contact[odd]
    assert results.find_step(int(results.steps.number[1])) == results.find_step(results.steps.number[1]) == 1


@pytest.mark.parametrize(("given", "kind", "said"), [
    ({"operator": np.array(["dense", "auto"])}, ValueError, "operator: found .*; expected one of auto, dense, hier"),
    ({"operator": "dens"}, ValueError, "operator: found 'dens'; expected one of auto, dense, hierarchical"),
    ({"force": np.ones(2)}, TypeError, r"force: found array\(.*; expected True or False"),
    ({"force": "yes"}, TypeError, "force: found 'yes'; expected True or False"),
    ({"petsc": ["ksp_monitor"]}, TypeError, "petsc: found .*; expected a dictionary"),
])  # fmt: skip
def test_runs_and_sweeps_refuse_odd_options(given: dict[str, Any], kind: type, said: str, tmp_path: Path) -> None:
    with pytest.raises(kind, match=said):
        pbem.run(tmp_path / "none.toml", **given)
    with pytest.raises(kind, match=said):
        pbem.sweep(tmp_path / "none.toml", {"interfaces.a.friction": [0.1]}, **given)


def test_steps_are_indices(results: Results) -> None:
    for odd in ([[1.0, 2.0], [3.0]], "last", 0.5, [[0]]):
        with pytest.raises(ValueError, match=r"steps: found .*; expected indices of stored steps"):
            results.choose_steps(odd)  # type: ignore[arg-type]
    assert results.choose_steps(-1) == [1] and results.choose_steps([0, 1]) == [0, 1]


@pytest.mark.parametrize("read", ["displacement_at", "traction_at"])
def test_fields_of_a_step_that_is_not_stored_do_not_blame_the_file(results: Results, read: str) -> None:
    for outside in (2, -3):
        with pytest.raises(IndexError, match=f"there is no stored step with index {outside}; 2 are stored"):
            getattr(results, read)(outside)
    with pytest.raises(ValueError, match="expected indices of stored steps"):
        getattr(results, read)(1.5)


def test_what_is_no_case_no_file_and_no_reporter_is_told_as_that(tmp_path: Path) -> None:
    for odd in (None, 3, []):
        with pytest.raises(TypeError, match=r"case: found .*; expected a pbem.Case, a dictionary of its tables"):
            pbem.run(odd, tmp_path / "a.h5")  # type: ignore[arg-type]
        with pytest.raises(TypeError, match=r"path: found .*; expected the path of a result file"):
            pbem.open_results(odd)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="reporter: found 'bar'; expected an object with at least one of the methods"):
        pbem.run(tmp_path / "none.toml", reporter="bar")  # type: ignore[arg-type]


def test_other_odd_options(results: Results, tmp_path: Path) -> None:
    with pytest.raises(TypeError, match="kept: found 'seat'; expected what"):
        pbem.run(tmp_path / "none.toml", kept="seat")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"x: found array\(.*; expected one of"):
        results.plot(curve="seat", x=np.ones((1, 2)))  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="resume: found 1; expected True or False"):
        pbem.run(tmp_path / "none.toml", resume=1)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="neighbours: found None; expected True or False"):
        pbem.sweep(tmp_path / "none.toml", {}, neighbours=None)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="listener: found 'print'; expected a function"):
        pbem.sweep(tmp_path / "none.toml", {}, listener="print")  # type: ignore[arg-type]


@pytest.mark.parametrize("odd", [np.ones((2, 2)), [], [1.0], "a", 0])
def test_what_is_set_is_a_dictionary(odd: Any, tmp_path: Path) -> None:
    path = tmp_path / "blocks.toml"
    path.write_text(BLOCKS)
    for source in (path, pbem.Case.read(path), tomllib.loads(BLOCKS)):
        with pytest.raises(pbem.CaseError, match=r"what is set: found .*; expected a dictionary"):
            pbem.run(source, tmp_path / "blocks.h5", set=odd)
    assert not (tmp_path / "blocks.h5").exists()


@pytest.mark.parametrize(("path", "reason"), [(".", "Is a directory"), ("there/is/no/such.toml", "No such file")])
def test_a_case_that_cannot_be_written_says_where_and_why(tmp_path: Path, path: str, reason: str) -> None:
    with pytest.raises(pbem.PbemError, match=f"cannot be written \\({reason}.*expected the path of a file"):
        pbem.Case(**tomllib.loads(BLOCKS)).write(tmp_path / path)
