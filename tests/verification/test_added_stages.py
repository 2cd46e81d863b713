"""Stages that are added to a finished run give the results of one run of all stages."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pbem
from pbem.errors import ResultFileError

CASE: dict[str, Any] = {
    "materials": {"rock": {"young": 700.0, "poisson": 0.3}},
    "curves": {
        "bottom": {"points": [[0, 0], [2, 0]], "elements": 6}, "right": {"points": [[2, 0], [2, 1]], "elements": 4},
        "seat": {"points": [[0, 1], [2, 1]], "elements": 8}, "left": {"points": [[0, 1], [0, 0]], "elements": 4},
        "side": {"points": [[2, 1], [2, 1.7]], "elements": 4}, "top": {"points": [[2, 1.7], [0, 1.7]], "elements": 6},
        "back": {"points": [[0, 1.7], [0, 1]], "elements": 4},
    },
    "regions": {"base": {"material": "rock", "boundary": ["bottom", "right", "seat", "left"]},
                "block": {"material": "rock", "boundary": ["seat", "side", "top", "back"]}},
    "interfaces": {"seat": {"law": "coulomb", "friction": 0.05}},
    "boundary": {"bottom": {"ux": 0.0, "uy": 0.0}, "top": {"un": 0.0, "us": 0.0}},
    "stages": [{"steps": 2, "boundary": {"top": {"un": -0.01}}}],
}  # fmt: skip


@pytest.mark.parametrize("push", [{"tn": -1.5, "ts": 0.3}, {"tx": -1.5, "ty": 0.3}])
def test_a_curve_that_was_free_is_pushed_in_a_stage_that_is_added(push: dict[str, float], tmp_path: Path) -> None:
    """Along the curve or along x and y: with tn and ts the file was said to be of another case."""
    whole = copy.deepcopy(CASE)
    whole["stages"] = [*CASE["stages"], {"steps": 2, "boundary": {"side": push}}]
    pbem.run(copy.deepcopy(CASE), tmp_path / "added.h5")
    added = pbem.run(copy.deepcopy(whole), tmp_path / "added.h5", resume=True)
    once = pbem.run(whole, tmp_path / "once.h5")
    assert len(added.steps.iterations) == len(once.steps.iterations) == 4
    seats = added.contact["seat"], once.contact["seat"]
    assert np.abs(seats[1].slip).max() > 1e-5
    assert np.abs(seats[0].slip - seats[1].slip).max() < 1e-12 * np.abs(seats[1].slip).max()
    for curve in ("bottom", "top"):
        assert np.abs(added.reactions[curve] - once.reactions[curve]).max() < 1e-10
    # The pushed side carries what it is given.
    assert abs(np.asarray(once.reactions["side"])[-1, 0] + 1.5 * 0.7) < 1e-9


def test_what_pushed_a_curve_before_is_kept(tmp_path: Path) -> None:
    """A curve that had a traction along x and y is not free: along the curve the past would be another."""
    before = copy.deepcopy(CASE)
    before["stages"][0]["boundary"]["side"] = {"tx": -1.0, "ty": 0.2}
    now = copy.deepcopy(before)
    now["stages"][0]["boundary"]["side"] = {"tn": -1.0, "ts": 0.2}
    pbem.run(before, tmp_path / "before.h5")
    with pytest.raises(ResultFileError, match=r"conditions\.side\.frame"):
        pbem.run(now, tmp_path / "before.h5", resume=True)
