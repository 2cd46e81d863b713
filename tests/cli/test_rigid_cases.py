"""Cases with rigid curves and tools: their faults, results, pictures, tables and sweeps; and on several ranks."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

import pbem
from pbem.case.build import parse_model
from pbem.errors import CaseError
from pbem.results.describe import describe_results
from pbem.results.facts import collect_facts

HEAD = """\
[materials.rock]
young = 1000.0
poisson = 0.2
[curves]
bottom = { points = [[0, 0], [1, 0]], elements = 2, grading = "none" }
right = { points = [[1, 0], [1, 1]], elements = 2, grading = "none" }
top = { points = [[1, 1], [0, 1]], elements = 3, grading = "none" }
left = { points = [[0, 1], [0, 0]], elements = 2, grading = "none" }
press = { points = [[0, 1], [1, 1]], elements = 3, grading = "none" }
[regions.block]
material = "rock"
boundary = ["bottom", "right", "top", "left"]
[contacts.seat]
between = ["top", "press"]
friction = 0.4
"""
CASE = HEAD + """\
[boundary.bottom]
rigid = { ux = 0.0, uy = 0.0, rotation = 0.0 }
[tools.press]
fy = -2.0
[[stages]]
name = "press"
steps = 1
[[stages]]
name = "shear"
steps = 2
[stages.tools.press]
fx = { expression = "0.1*(t - 1)" }
moment = 0.05
[stages.boundary.bottom]
rigid = { uy = 0.001 }
"""


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> pbem.Results:
    """Of the case above."""
    folder = tmp_path_factory.mktemp("rigid")
    (folder / "case.toml").write_text(CASE)
    return pbem.run(folder / "case.toml", folder / "case.h5")


def test_forces_and_motions_of_stages(results: pbem.Results) -> None:
    press, bottom = results.rigid["press"], results.rigid["bottom"]
    assert (press.tool, bottom.tool, press.known, bottom.known) == (True, False, ("force",) * 3, ("motion",) * 3)
    np.testing.assert_allclose(press.about, [0.5, 1.0])
    np.testing.assert_allclose(press.force, [[0, -2, 0], [0.05, -2, 0.025], [0.1, -2, 0.05]], atol=1e-12)
    np.testing.assert_allclose(bottom.motion, [[0, 0, 0], [0, 5e-4, 0], [0, 1e-3, 0]], atol=1e-15)
    # The bottom holds what acts on the press; the block is of height 1.
    np.testing.assert_allclose(bottom.force[:, :2], -press.force[:, :2], atol=1e-3)
    assert press.motion[0, 1] == pytest.approx(-2 * 0.96 / 1000, rel=0.1)
    assert results.balance is not None and results.balance.relative.max() < 1e-3


def test_they_are_shown_and_in_tables(results: pbem.Results, tmp_path: Path) -> None:
    text = describe_results(results)
    assert "rigid bodies at the last step" in text and "press (tool)" in text
    assert collect_facts(results)["rigid"]["press"]["fx"] == pytest.approx(0.1)
    table = results.to_dataframe("rigid")
    assert list(table.columns[3:]) == ["body", "fx", "fy", "moment", "ux", "uy", "rotation"] and len(table) == 6
    results.plot(field="syy").savefig(tmp_path / "field.png")
    inside = results.evaluate([[0.5, 0.5], [0.5, 1.0], [0.5, 1.2]])
    assert inside.region.tolist() == ["block", "block", ""]


def test_sweeps_take_them(tmp_path: Path) -> None:
    table = pbem.sweep(
        pbem.Case.read(write(tmp_path, CASE)), {"tools.press.fy": [-2.0, -4.0]},
        quantities=["rigid.press.uy", "rigid.*.fy"],
    )
    np.testing.assert_allclose(table["rigid.press.fy"], [-2.0, -4.0])
    np.testing.assert_allclose(table["rigid.bottom.fy"], [2.0, 4.0], rtol=1e-3)
    assert table["rigid.press.uy"][1] < table["rigid.press.uy"][0]


def write(folder: Path, text: str) -> Path:
    (folder / "case.toml").write_text(text)
    return folder / "case.toml"


def test_a_run_that_was_cut_off_goes_on(results: pbem.Results, tmp_path: Path) -> None:
    case, path = write(tmp_path, CASE), tmp_path / "case.h5"
    path.write_bytes(Path(results.path).read_bytes())
    with h5py.File(path, "r+") as file:
        file["steps/number"].resize(2, axis=0)
        file.attrs["status"] = "stopped"
    resumed = pbem.run(case, path, resume=True)
    for kind in ("force", "motion"):
        expected = getattr(results.rigid["press"], kind)
        np.testing.assert_allclose(getattr(resumed.rigid["press"], kind), expected, atol=1e-12)


FAULTS = {
    "fy = -2.0\nuy = 0.0": "tools.press.uy",
    "fy = -2.0\n[tools.block]": "tools.block",
    "fy = -2.0\n[tools.left]": "tools.left",
    "fy = { table = [[0, 1], [1, 2]] }": "tools.press.fy",
    "fy = -2.0\n[boundary.left]\nrigid = { fx = 0.0, curves = [\"top\", \"no\"] }": "boundary.left.rigid.curves[1]",
    "fy = -2.0\n[boundary.left]\nforce = { fx = 1.0, moment = 1.0 }": "boundary.left.force.moment",
    "fy = -2.0\n[boundary.left]\nforce = { fx = 1.0 }\ntx = 0.0": "boundary.left.force",
    "fy = -2.0\n[[stages]]\n[stages.tools.pres]\nfy = 1.0": "stages[1].tools.pres",
    "fy = -2.0\n[[stages]]\n[stages.boundary.right]\nrigid = { fy = 1.0 }": "stages[1].boundary.right.rigid",
    "fy = -2.0\n[[stages]]\n[[stages]]\n[stages.tools.press]\nuy = 1.0": "stages[2].tools.press.uy",
    "fy = 2.0": "tools.press",
}


@pytest.mark.parametrize("given", FAULTS)
def test_faults_are_told_at_their_place(given: str) -> None:
    text = f"{HEAD}[boundary.bottom]\nux = 0.0\nuy = 0.0\n[tools.press]\n{given}\n"
    if given == "fy = 2.0":
        text = text.replace("[[0, 1], [1, 1]]", "[[0, 1.1], [1, 1.1]]")  # away from the block
    with pytest.raises(CaseError) as caught:
        parse_model(text)
    assert FAULTS[given] in [fault.place.partition(" (line")[0] for fault in caught.value.faults]


def test_curves_of_two_bodies_move_as_one(tmp_path: Path) -> None:
    """A beam on two posts, pressed beside its middle: the near post carries as much more as the lever says."""
    posts = "[curves]\n" + "".join(f"""\
foot{name} = {{ points = [[{x}, 0], [{x + 1}, 0]], elements = 2 }}
right{name} = {{ points = [[{x + 1}, 0], [{x + 1}, 1]], elements = 2 }}
head{name} = {{ points = [[{x + 1}, 1], [{x}, 1]], elements = 2 }}
left{name} = {{ points = [[{x}, 1], [{x}, 0]], elements = 2 }}
""" for name, x in (("a", 0), ("b", 9)))
    regions = "".join(f"""\
[regions.post{name}]
material = "rock"
boundary = ["foot{name}", "right{name}", "head{name}", "left{name}"]
[boundary.foot{name}]
uy = 0.0
ux = 0.0
""" for name in "ab")
    text = f"""\
{HEAD[:HEAD.index("[curves]")]}{posts}{regions}[boundary.heada]
rigid = {{ fy = -1.0, moment = 2.25, about = [5.0, 1.0], curves = ["headb"] }}
[analysis]
steps = 1
"""
    results = pbem.run(write(tmp_path, text), tmp_path / "posts.h5")
    # Posts 9 apart: half of the force each, and the moment less what they are bent by.
    near, far = results.reactions["heada"][-1, 1], results.reactions["headb"][-1, 1]
    assert near + far == pytest.approx(-1.0, abs=1e-12)
    assert near == pytest.approx(-0.75, rel=0.02) and far == pytest.approx(-0.25, rel=0.06)
    np.testing.assert_allclose(results.rigid["heada"].force[-1], [0.0, -1.0, 2.25], atol=1e-12)


RANKS = """
import sys
from tests.verification.rigid_sample import Place, expect_bar, lay_bar
from tests.verification.proofs.proof import solve_model
place = Place(turn=0.4)
for end in ("rigid", "tool"):
    for operator, scheme in (("dense", "SST"), ("hierarchical", "THST")):
        expect_bar(solve_model(lay_bar(place, end, scheme, operator)), place, 1e-7)
"""


def test_bars_on_several_ranks(mpirun_snippet: Callable[..., subprocess.CompletedProcess[str]]) -> None:
    done = mpirun_snippet(3, RANKS, cwd=Path(__file__).parents[2])
    assert done.returncode == 0, done.stderr
