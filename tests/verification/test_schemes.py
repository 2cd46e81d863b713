"""Bodies in contact carry the same forces by every scheme, and are in balance: a stack, a wedge, a bonded block.

Where elements at corners and ends of contact had traction equations, forces were 1 to 5 % off and did not converge.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

import pbem
from pbem.results.reader import Results
from scripts import study_stacks

pytestmark = pytest.mark.usefixtures("without_errors")

GAP = 2.4e-4
WEDGE = study_stacks.Sample(
    kind="wedge", gap=GAP, approach=3.3e-3, friction=0.3, stiffness=5.6, scheme="SST", elements=12, width=0.7,
)  # fmt: skip
STACK = replace(WEDGE, kind="stack", approach=2e-4, friction=0.0, width=1.3)
SAMPLES = {"wedge": WEDGE, "stack": STACK}


@cache
def find_force(kind: str, folder: Path) -> float:
    """The force by SST with more elements, without gaps."""
    return run_sample(replace(SAMPLES[kind], elements=20), True, folder)[1]


def run_sample(sample: study_stacks.Sample, closed: bool, folder: Path) -> tuple[float, float]:
    """The part of the forces that is left over, and the force that presses."""
    case = folder / "case.toml"
    case.write_text(study_stacks.write(sample, sample.elements, "dense", closed), encoding="utf-8")
    return study_stacks.measure(pbem.run(case, folder / "case.h5", force=True))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("schemes")


@pytest.mark.parametrize("closed", [True, False], ids=["closed", "gaps"])
@pytest.mark.parametrize("scheme", ["SST", "DBEM", "HST", "THST"])
@pytest.mark.parametrize("kind", SAMPLES)
def test_bodies_in_contact_carry_the_same_by_every_scheme(kind: str, scheme: str, closed: bool, folder: Path) -> None:
    left, force = run_sample(replace(SAMPLES[kind], scheme=scheme), closed, folder)
    assert left < 4e-4
    assert force == pytest.approx(find_force(kind, folder), rel=4e-3)


BONDED = """
materials.a = {{ young = 1000.0, poisson = 0.2 }}
materials.b = {{ young = 8000.0, poisson = 0.3 }}
analysis = {{ steps = 1, scheme = "{scheme}" }}
curves.bottom = {{ points = [[-1, 0], [2, 0]], elements = 8, grading = "{grading}" }}
curves.around = {{ points = [[2, 0], [2, 1], [1, 1]], elements = 16, grading = "{grading}" }}
curves.joint = {{ points = [[0, 1], [1, 1]], elements = 8, grading = "{grading}" }}
curves.beyond = {{ points = [[0, 1], [-1, 1], [-1, 0]], elements = 16, grading = "{grading}" }}
curves.right = {{ points = [[1, 1], [1, 2]], elements = 8, grading = "{grading}" }}
curves.top = {{ points = [[1, 2], [0, 2]], elements = 8, grading = "{grading}" }}
curves.left = {{ points = [[0, 2], [0, 1]], elements = 8, grading = "{grading}" }}
regions.base = {{ material = "a", boundary = ["bottom", "around", "joint", "beyond"] }}
regions.block = {{ material = "b", boundary = ["joint", "right", "top", "left"] }}
interfaces.joint = {{ law = "bonded" }}
boundary.bottom = {{ ux = 0.0, uy = 0.0 }}
boundary.top = {{ ux = 0.0005, uy = -0.001 }}
"""


@pytest.mark.parametrize("scheme", ["DBEM", "HST", "THST"])
@pytest.mark.parametrize(("grading", "part", "left"), [("auto", 1e-3, 8e-4), ("none", 1e-3, 1.2e-3)])
def test_a_bonded_block_carries_the_same_by_every_scheme(
    scheme: str, grading: str, part: float, left: float, folder: Path
) -> None:
    def solve(each: str) -> Results:
        case = folder / "bonded.toml"
        case.write_text(BONDED.format(scheme=each, grading=grading), encoding="utf-8")
        return pbem.run(case, folder / "bonded.h5", force=True)

    one, other = solve("SST"), solve(scheme)
    expected = one.reactions["top"][-1]
    assert other.reactions["top"][-1] == pytest.approx(expected, abs=part * abs(expected[1]))
    assert other.balance is not None and other.balance.relative[-1].max() < left
