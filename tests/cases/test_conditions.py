"""The checks of this folder are seen to fail: on result files that were tampered with, and on lines that are wrong."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from tests.cases.bundled import CASES, Solve
from tests.cases.conditions import find_faults
from tests.cases.expectations import check_expectation, parse_expectations


def change(name: str, where: tuple, edit: Callable[[Any], Any]) -> Callable[[h5py.File], None]:
    """Tampering with a part of a dataset."""

    def apply(file: h5py.File) -> None:
        values = file[name][...]
        values[where] = edit(values[where])
        file[name][...] = values

    return apply


def drop(name: str) -> Callable[[h5py.File], None]:
    """Tampering by leaving something out."""

    def apply(file: h5py.File) -> None:
        del file[name]

    return apply


def fail(file: h5py.File) -> None:
    """Tampering with the status."""
    file.attrs["status"] = "failed"


def shorten(file: h5py.File) -> None:
    """Tampering with the shape of a dataset."""
    file["all/contact/slip"].resize(0, axis=0)


# The interface slips up to x = 1.96 and sticks beyond; pair 30 slips, pair 59 sticks.
SLIPPING, STICKING = (0, 30), (0, 59)
contact = "contact/interface/{}".format
TAMPERED = {
    "failed": (fail, "status 'failed'"),
    "dataset missing": (drop("nodes/normal"), "nodes/normal is missing"),
    "field missing": (drop(contact("mode")), "contact/interface/mode is missing"),
    "shape": (shorten, "contact/interface/slip has the shape (0, 60), expected (1, 60)"),
    "not finite": (change("fields/traction", (0, 0), lambda _: np.nan), "fields/traction is not finite"),
    "nodes' normals": (change("nodes/normal", (0,), lambda n: 2 * n), "nodes/normal are no unit vectors"),
    "pairs' normals": (change(contact("normal"), (0,), lambda n: 2 * n), "normals are no unit vectors"),
    "last step": (change("steps/factor", (0,), lambda _: 0.5), "steps do not go forward"),
    "balance": (change("reactions/top", (0, 0), lambda r: 1.01 * r), "reactions are out of balance by 9.8e-03"),
    "order": (change(contact("arc_length"), (0,), lambda _: 1.0), "pairs are not sorted"),
    "mode": (change(contact("mode"), SLIPPING, lambda _: 3), "an unknown mode at 1 places, first in step 1 at arc"),
    "penetration": (change(contact("opening"), SLIPPING, lambda _: -1e-7), "penetration at 1 places"),
    "opening": (change(contact("opening"), STICKING, lambda _: 1e-7), "opening of a closed pair at 1 places"),
    "tension": (change(contact("traction_n"), SLIPPING, lambda _: 1e-6), "tension beyond the strength at 1 places"),
    "open": (change(contact("mode"), SLIPPING, lambda _: 2), "traction of an open pair at 1 places"),
    "cone": (change(contact("traction_s"), STICKING, lambda t: 30 * t), "friction beyond the cone at 1 places"),
    "below": (change(contact("traction_s"), SLIPPING, lambda t: 0.9 * t), "slip below the cone at 1 places"),
    "direction": (change(contact("slip"), SLIPPING, lambda g: -g), "slip against friction at 1 places"),
    "sticking": (change(contact("slip"), STICKING, lambda _: 1e-7), "slip of a sticking pair at 1 places"),
}  # fmt: skip


@pytest.mark.parametrize("kind", TAMPERED)
def test_a_tampered_result_is_found(kind: str, tmp_path: Path, solve: Solve) -> None:
    path = tmp_path / "tampered.h5"
    shutil.copy(solve("two_blocks").path, path)
    assert find_faults(path) == []
    tamper, expected = TAMPERED[kind]
    with h5py.File(path, "r+") as file:
        tamper(file)
    faults = find_faults(path)
    assert any(expected in fault for fault in faults), faults


@pytest.mark.parametrize("line", [
    "# expect reactions.top.z = 1",
    "# expect reactions.top.x = one",
    "# expect reactions.top.x is 1",
    "# expect reactions.top.x = 1 within 1 %",
    "# expect reactions.top.x = 1 within 0.1 of the largest",
    "# expect contact.crack.slide at 0.5 = 1",
    "# expect contact.crack.slip at the mouth = 1",
    "# expect contact.*.slip at 0.5 = 1",
    "# expect contact.crack.closed count = 1",
    "# expect tips.crack.K1 end = 1",
    "# Expect reactions.top.x = 1",
    "#expect reactions.top.x = 1",
])  # fmt: skip
def test_a_line_that_is_not_understood_is_refused(line: str) -> None:
    with pytest.raises(ValueError, match=r"not understood|only a field at a place"):
        parse_expectations(f"# A title\n{line}\n")


# Of the two blocks, whose numbers are known well.
@pytest.mark.parametrize(("line", "holds"), [
    ("reactions.top.x = 2.6627 within 1e-4", True),
    ("reactions.top.x = 2.7 within 1e-2", False),
    ("reactions.top.x after load = 2.7 within 1.5e-2", True),
    ("reactions.top.y = 2.7066 within 1e-2", False),
    ("reactions.top.x = 2.6636 within 1e-3 absolute", True),
    ("reactions.top.x = 2.6638 within 1e-3 absolute", False),
    ("contact.interface.slip count = 50", True),
    ("contact.interface.slip count = 51", False),
    ("contact.*.slip share = 0.83333 within 1e-4", True),
    ("contact.*.stick share = 0.83333 within 1e-4", False),
    ("contact.interface.slip largest = 1.046e-3 within 1e-2", True),
    ("contact.interface.slip largest = 0.95e-3 within 1e-2", False),
    ("contact.interface.slip start = 0", True),
    ("contact.interface.slip end = 1.96 within 0.01 absolute", True),
    ("contact.interface.slip end = 1.95 within 0.01 absolute", False),
    ("contact.interface.stick end = 2 within 1e-12 absolute", True),
    ("contact.interface.opening at 0.5 = 0 within 1e-12 absolute", True),
    ("contact.interface.slip at 0.5 = -8.2e-4 within 1e-2 of the largest", True),
    ("contact.interface.slip at 0.5 = -8.0e-4 within 1e-2 of the largest", False),
    ("contact.interface.slip at 0.5 = 8.2e-4 within 1e-2 of the largest", False),
])  # fmt: skip
def test_a_number_that_is_off_is_found(line: str, holds: bool, solve: Solve) -> None:
    (expected,) = parse_expectations(f"# expect {line}")
    _, error = check_expectation(solve("two_blocks"), expected)
    assert (error <= 1) == holds, f"{error:g} times the tolerance"


def test_a_mode_that_does_not_occur_has_no_zone(solve: Solve) -> None:
    (expected,) = parse_expectations("# expect contact.interface.open start = 0")
    with pytest.raises(AssertionError, match="no pair of interface is in the mode open"):
        check_expectation(solve("two_blocks"), expected)


def test_all_lines_of_a_file_are_read() -> None:
    text = CASES["two_blocks"].read_text(encoding="utf-8")
    assert len(parse_expectations(text)) == sum("expect " in line for line in text.splitlines()) >= 8
