"""The forms of tips are derived by any rank, in any parts, and taken by the one that writes."""

from __future__ import annotations

import numpy as np
import pytest

from pbem.bundled import find_bundled
from pbem.case.build import read_model
from pbem.mesh.generate import generate_mesh
from pbem.results import tip_shape
from pbem.results.tips import collect_tip_rules


@pytest.mark.parametrize("parts", [1, 3])
def test_forms_that_are_taken_are_those_of_the_rank_itself(parts: int, monkeypatch: pytest.MonkeyPatch) -> None:
    model = read_model(find_bundled("crack_field"))[1]
    mesh = generate_mesh(model)
    own, taken = collect_tip_rules(model, mesh), collect_tip_rules(model, mesh)
    assert len(own.groups) > 3
    own.derive()
    for part in range(parts):
        taken.take(collect_tip_rules(model, mesh).derive(slice(part, None, parts)))
    monkeypatch.delattr(tip_shape, "_Near")  # nothing is derived any more
    monkeypatch.delattr(tip_shape, "_integrate_straight_crack")
    for one, other in zip(own.groups, taken.groups, strict=True):
        for name in ("intensity", "release", "parallel", "of_mean", "of_normal"):
            assert np.array_equal(getattr(one.forms, name), getattr(other.forms, name)), name
