"""Laws of one's own are tried when the case is read: what fails is a fault of the case."""

from __future__ import annotations

from pathlib import Path

import pytest

from pbem.contact.strength import read_checked_model
from pbem.errors import CaseError
from tests.unit.case_sample import BLOCKS, change

GOOD = """
from pbem.contact.strength import Strength

def strength(p_n, slip, friction):
    return Strength(-friction * p_n, 0 * p_n - friction, 0 * p_n)
"""


def write_case(folder: Path, law: str) -> Path:
    (folder / "law.py").write_text(law)
    keys = 'law = "custom"\nfile = "law.py"\nparameters = { friction = 0.5 }'
    text = change(BLOCKS, ("friction = 0.5", keys)) if "friction = 0.5" in BLOCKS else BLOCKS
    path = folder / "case.toml"
    path.write_text(text.replace('law = "coulomb"\n', ""))
    return path


def test_a_sound_law_is_accepted(tmp_path: Path) -> None:
    model = read_checked_model(write_case(tmp_path, GOOD))
    assert [joint.law.kind for joint in model.interfaces.values()] == ["custom"]


@pytest.mark.parametrize(
    ("law", "text"),
    [
        ("import no_such_module", "No module named"),
        ("x = 1", "no function named strength"),
        ("def strength(p_n, slip): return p_n", "unexpected keyword argument"),
        ("def strength(p_n, slip, friction): return -friction * p_n", "bound"),
        (GOOD.replace("-friction * p_n,", "-0.3,"), "a bound of shape () for a p_n of shape (2,)"),
        (GOOD.replace("-friction * p_n,", "0 * p_n + float('nan'),"), "gives bound = nan at p_n = -1"),
    ],
)
def test_a_law_that_fails_is_a_fault_with_its_place(tmp_path: Path, law: str, text: str) -> None:
    with pytest.raises(CaseError) as caught:
        read_checked_model(write_case(tmp_path, law))
    (fault,) = caught.value.faults
    assert fault.place.startswith("interfaces.")
    assert text in fault.found
